"""Traffic that a trained model of tokens moves; needs torch."""

from __future__ import annotations

from scenarionet_data.generation.token_training import draw, load_tokens  # first: needs torch

# isort: split
from collections.abc import Hashable
from dataclasses import dataclass, field, replace
from functools import lru_cache
from weakref import WeakKeyDictionary

import numpy as np
import torch
from torch import Tensor

from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Int64, UInt8
from scenarionet_data.arrays.geometry import wrap_angle
from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.generation.frames import composed
from scenarionet_data.generation.token_model import Sight, TokenModel, TokenScene
from scenarionet_data.generation.token_recordings import KIND_OF, map_pieces
from scenarionet_data.generation.tokens import STEPS
from scenarionet_data.storage.files.places import open_files
from scenarionet_sim.arrays.log import HEADING, VALID, VX, VY, YAW_RATE, X, Y
from scenarionet_sim.policies.base import Policy
from scenarionet_sim.roads.road_pieces import joined
from scenarionet_sim.roads.roads import Roads
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world import World
from scenarionet_sim.worlds.world_batch import WorldBatch

POSE = [X, Y, HEADING]
_BEYOND = 50.0  # from the area of the recording: where an object leaves [m]
_HISTORY = 4  # tokens before the episode that the memory begins with


@dataclass(frozen=True)
class TokenTraffic(Policy):
    """Objects that a model of tokens moves: every half second each takes one, which it then follows.

    An object appears as recorded, follows the recording until the next tokens are taken, and then stays until it is
    50 m outside of the area of the recording. Kinds of objects without tokens are as recorded. The decisions of all
    worlds are one batch, in which networks round differently for other numbers of worlds.

    Attributes:
        run: Name of the training run.
        lake: Path or URL of the lake that has it.
        share: The most probable tokens that make up this share of all together are drawn from.
        seed: Seed of the episode's draws.
    """

    run: str = ""
    lake: str = "."
    share: float = 0.95
    seed: int = 0

    @property
    def together(self) -> Hashable:
        """Episodes differ by their seed only."""
        return replace(self, seed=0)

    def sampled(self, rng: np.random.Generator) -> TokenTraffic:
        """Return the policy of an episode."""
        return replace(self, seed=int(rng.integers(2**32)))

    def begin(self, batch: WorldBatch, state: State, slot: int) -> None:
        """Prepare for an episode that begins in a slot."""
        model = loaded(self.lake, self.run)
        episode = _Episode.of(batch.worlds[slot], model, self.seed)
        episode.has_entered |= state.present[slot, : len(episode.kind)]
        now = int(state.timestep[slot])
        for step in range(now - STEPS * _HISTORY, now, STEPS):
            if step >= 0:
                poses, ok = episode.log[step][:, POSE], episode.log[step][:, VALID] != 0
                _perceived(model, [episode], [(poses, ok, episode.log[step][:, VX : VY + 1])])
        _EPISODES.setdefault(batch, {})[self.together, slot] = episode

    def advance(self, batch: WorldBatch, now: State, then: State, driver: UInt8, policy_id: int, dt: float) -> None:
        """Write the next state of its objects."""
        model, episodes = loaded(self.lake, self.run), _EPISODES[batch]
        is_own = driver == policy_id
        slots = np.flatnonzero(is_own.any(axis=1)).tolist()
        playing = {slot: episodes[self.together, slot] for slot in slots}
        deciding = [slot for slot, episode in playing.items() if episode.phase == 0]
        if deciding:
            seen = [
                (now.motion[slot, :count][:, POSE], now.present[slot, :count], now.motion[slot, :count, VX : VY + 1])
                for slot in deciding
                for count in [len(playing[slot].kind)]
            ]
            _decide(model, [playing[slot] for slot in deciding], seen, self.share)
        for slot, episode in playing.items():
            episode.move(now, then, slot, is_own[slot, : len(episode.kind)], dt)


@dataclass(eq=False)
class _Episode:
    """What plays in a slot with N objects.

    Attributes:
        log: (T, N, 8) the recording; extents (4,) its area [m].
        kind: (N,) of ``tokens.KINDS``, -1 for objects without tokens.
        build: (N, 2) length and width [m].
        pieces: (P, 5) of the map.
        rng: Of the draws.
        memory: (N, size) of the model.
        before: (N, 3) poses a token ago, where ``was_there``.
        path: (N, STEPS, 3) poses of the tokens that are followed, where ``has_path``.
        has_entered: (N,) who was there in this episode.
        phase: Timesteps of the tokens that are done.
    """

    log: Float32
    extents: Float32
    kind: Int64
    build: Float32
    pieces: Float32
    rng: np.random.Generator
    memory: Tensor
    before: Float64
    was_there: Bool
    path: Float64
    has_path: Bool
    has_entered: Bool
    phase: int = field(default=0)

    @classmethod
    def of(cls, world: World, model: TokenModel, seed: int) -> _Episode:
        """Return the episode of a world in which nothing was there yet."""
        count, kind = world.num_objects, KIND_OF[world.object_type]
        has_tokens = np.append(model.has_token.any(dim=1).numpy(), False)
        nobody, memory = np.zeros(count, np.bool_), torch.zeros(count, model.config.size)
        return cls(
            world.log, world.extents, np.where(has_tokens[kind], kind, -1), world.size[:, :2],
            world.roads.once(_pieces), np.random.default_rng(seed), memory, np.zeros((count, 3)), nobody,
            np.zeros((count, STEPS, 3)), nobody, nobody.copy(),
        )  # fmt: skip

    def move(self, now: State, then: State, slot: int, is_own: Bool, dt: float) -> None:
        """Write the next state of the objects at a mask (N,)."""
        count, step = len(self.kind), int(now.timestep[slot]) + 1
        row = self.log[min(step, len(self.log) - 1)]
        is_recorded = (row[:, VALID] != 0) & (step < len(self.log))
        present, motion, old = then.present[slot, :count], then.motion[slot, :count], now.motion[slot, :count]
        was = now.present[slot, :count]
        goes = is_own & self.has_path & was
        poses = self.path[goes, self.phase]
        motion[goes, VX : VY + 1] = (poses[:, :2] - old[goes, :2]) / dt
        motion[goes, YAW_RATE] = wrap_angle(poses[:, 2] - old[goes, HEADING]) / dt
        motion[goes, X : Y + 1], motion[goes, HEADING] = poses[:, :2], poses[:, 2]
        x0, y0, x1, y1 = self.extents + np.array([-_BEYOND, -_BEYOND, _BEYOND, _BEYOND])
        x, y = motion[:, X], motion[:, Y]
        is_inside = (x >= x0) & (x <= x1) & (y >= y0) & (y <= y1)
        # Those without tokens, those that come, and those that came since tokens were taken are as recorded.
        follows = is_own & ~goes & ((self.kind < 0) | was | ~self.has_entered)
        placed = follows & is_recorded
        motion[placed] = row[placed, :VALID]
        present[is_own] = (goes & is_inside | placed)[is_own]
        self.has_entered |= present
        self.phase = (self.phase + 1) % STEPS


_Seen = tuple[Float64 | Float32, Bool, Float64 | Float32]
"""Poses (N, 3), who is there (N,), and velocities (N, 2) of an episode's objects."""

_EPISODES: WeakKeyDictionary[WorldBatch, dict[tuple[Hashable, int], _Episode]] = WeakKeyDictionary()


@lru_cache(maxsize=4)
def loaded(lake: str, run: str) -> TokenModel:
    """Return the model of a training run, as often as it is asked for."""
    torch.set_num_threads(1)
    return load_tokens(open_files(lake), run)


def _pieces(roads: Roads) -> Float32:
    """Pieces (P, 5) of a map, as in training."""
    owner = roads.segment_feature
    lines = joined(roads.segments, owner)
    first = np.append(0, np.cumsum(lines.lengths - 1)[:-1]) if len(lines) else np.zeros(0, np.intp)
    lengths = np.concatenate([roads.lanes.lengths, lines.lengths])
    every = Ragged.from_flat(lengths, np.concatenate([roads.lanes.values, lines.values]))
    return map_pieces(every, np.concatenate([roads.lane_type, roads.segment_type[first]]))


@torch.no_grad()
def _perceived(model: TokenModel, episodes: list[_Episode], seen: list[_Seen]) -> tuple[Tensor, Tensor, Sight, Tensor]:
    """Remember a moment of episodes; return their rows (R, 2), features with the memory, sight and poses."""
    most, longest = max(len(each.kind) for each in episodes), max(len(each.pieces) for each in episodes)
    count = len(episodes)
    maps = {id(each.pieces): each.pieces for each in episodes}
    numbers = {key: number for number, key in enumerate(maps)}
    poses, before, build = torch.zeros(count, most, 3), torch.zeros(count, most, 3), torch.ones(count, most, 2)
    ok, kind = torch.zeros(count, most, dtype=torch.bool), torch.zeros(count, most, dtype=torch.long)
    pieces = torch.full((len(maps), max(longest, 1), 5), -1.0)
    for number, each in enumerate(maps.values()):
        pieces[number, : len(each)] = torch.from_numpy(each)
    for g, (episode, (pose, there, velocity)) in enumerate(zip(episodes, seen, strict=True)):
        n, there = len(pose), there & (episode.kind >= 0)
        earlier = np.where(episode.was_there[:, None], episode.before, 0.0)
        fresh = ~episode.was_there
        earlier[fresh, :2], earlier[fresh, 2] = (pose[:, :2] - 0.5 * velocity)[fresh], pose[fresh, 2]
        poses[g, :n], before[g, :n] = torch.from_numpy(np.array(pose)), torch.from_numpy(earlier)
        build[g, :n] = torch.from_numpy(episode.build)
        ok[g, :n], kind[g, :n] = torch.from_numpy(there), torch.from_numpy(np.maximum(episode.kind, 0))
        episode.before, episode.was_there = np.array(pose, np.float64), there
    on = torch.tensor([numbers[id(each.pieces)] for each in episodes])
    where, sight = model.look(TokenScene(poses, ok, before, build, kind, pieces, on))
    group, number = where.unbind(dim=1)
    memory = torch.zeros(count, most, model.config.size)
    for g, episode in enumerate(episodes):
        memory[g, : len(episode.kind)] = episode.memory
    features = model.remember(model.perceive(sight), memory[group, number])
    memory = torch.zeros_like(memory)
    memory[group, number] = features
    for g, episode in enumerate(episodes):
        episode.memory = memory[g, : len(episode.kind)]
    return where, features, sight, poses[group, number]


@torch.no_grad()
def _decide(model: TokenModel, episodes: list[_Episode], seen: list[_Seen], share: float) -> None:
    """Let the objects of episodes take tokens."""
    where, features, sight, poses = _perceived(model, episodes, seen)
    group, number = where.unbind(dim=1)
    chances = [torch.from_numpy(each.rng.random(len(each.kind)).astype(np.float32)) for each in episodes]
    chance = torch.stack([chances[g][n] for g, n in where.tolist()]) if len(where) else torch.zeros(0)
    chosen = draw(model.decide(features, sight), share, chance)
    paths = composed(poses[:, None], model.paths[sight.kind, chosen]).numpy()
    for g, episode in enumerate(episodes):
        rows = (group == g).numpy()
        episode.path, episode.has_path = np.zeros_like(episode.path), np.zeros_like(episode.has_path)
        episode.path[number[rows].numpy()], episode.has_path[number[rows].numpy()] = paths[rows], True
