"""Train a model of tokens: by behaviour cloning, or closed-loop, on what its own choices lead to."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

import torch
from torch import Tensor, nn

from scenarionet_data.errors import BadParameter
from scenarionet_data.generation.frames import composed, relative
from scenarionet_data.generation.token_model import NEAR, TokenConfig, TokenModel, TokenScene
from scenarionet_data.generation.tokens import BOXES, KINDS, STEP, STEPS, apart, choose_tokens, corners, motions
from scenarionet_data.learning.fitting import BatchLosses, FitRun, fit, load_model
from scenarionet_data.storage.files.lake_files import LakeFiles

_MOTIONS = 200_000  # of which tokens are chosen

Pick = Callable[[int, Tensor, Tensor], Tensor]
"""Returns the tokens (R,) that road users take, from the moment, log probabilities and distances from the recording
(R, tokens) [m]."""


class Recordings(NamedTuple):
    """S scenarios at every timestep of 0.1 s: metres, radians, metres per second.

    Attributes:
        states: (S, A, T, 5) x, y, heading, velocity x, y; ``ok`` (S, A, T).
        build: (S, A, 2) length and width.
        kind: (S, A) of ``tokens.KINDS``.
        pieces: (S, P, 5) of the maps, see ``TokenScene``.
    """

    states: Tensor
    ok: Tensor
    build: Tensor
    kind: Tensor
    pieces: Tensor

    def take(self, rows: Tensor, device: torch.device) -> Recordings:
        """The scenarios at ``rows``, on a device, without what none of them has."""
        states, ok, build, kind, pieces = (values[rows].to(device) for values in self)
        some, moments = ok.any(dim=2).any(dim=0), ok.any(dim=1).any(dim=0)
        objects, last = int(torch.nonzero(some).max()) + 1, int(torch.nonzero(moments).max()) + 1
        longest = int((pieces[..., 4] >= 0).sum(dim=1).max())
        return Recordings(
            states[:, :objects, :last],
            ok[:, :objects, :last],
            build[:, :objects],
            kind[:, :objects],
            pieces[:, :longest],
        )

    def mirrored(self, is_chosen: Tensor) -> Recordings:
        """These scenarios, those at a mask (S,) mirrored."""
        signs = torch.tensor([1.0, -1.0, -1.0, 1.0, -1.0]), torch.tensor([1.0, -1.0, -1.0, 1.0, 1.0])
        states, pieces = (
            torch.where(is_chosen.view(-1, *[1] * (values.ndim - 1)), values * sign.to(values.device), values)
            for values, sign in zip((self.states, self.pieces), signs, strict=True)
        )
        return self._replace(states=states, pieces=pieces)


class Rolled(NamedTuple):
    """What road users did in B scenarios, at T moments a token apart.

    Attributes:
        poses, before: (B, T, A, 3) poses, and those a token earlier.
        recorded: (B, T, A, 3); ``ok`` (B, T, A) recorded there.
        target, taken: (B, T, A) token that leads to the recording, and the one that was taken; -1 where none was.
    """

    poses: Tensor
    before: Tensor
    recorded: Tensor
    ok: Tensor
    target: Tensor
    taken: Tensor


def fill_tokens(model: TokenModel, recordings: Recordings, generator: torch.Generator) -> None:
    """Choose the tokens of a model from recorded motions.

    Raises:
        BadParameter: No motion is as long as a token.
    """
    for number, name in enumerate(KINDS):
        found = [
            motions(states[kind == number, :, :3], ok[kind == number])
            for states, ok, kind in zip(recordings.states, recordings.ok, recordings.kind, strict=True)
        ]
        paths = torch.cat(found)
        paths = paths[torch.randperm(len(paths), generator=generator)[:_MOTIONS]]
        chosen = choose_tokens(paths, BOXES[number], model.config.tokens, model.config.radius, generator)
        model.paths[number, : len(chosen)], model.has_token[number, : len(chosen)] = chosen, True
        if name == KINDS[0] and not len(chosen):
            raise BadParameter(f"no vehicle is there for {STEPS * STEP:g} s; give a database with longer recordings")


def roll(
    model: TokenModel, recordings: Recordings, first: int, pick: Pick, *, sees: bool, lost: float = torch.inf
) -> Rolled:
    """Let the road users of scenarios take tokens one after the other; each is there while the recording has it.

    Args:
        model: The model.
        recordings: Scenarios.
        first: Timestep of the first moment.
        pick: Which tokens they take.
        sees: Whether that needs log probabilities; otherwise these are zeros.
        lost: Who comes further than this from the recording goes on from there [m].
    """
    states = recordings.states[:, :, first::STEPS].transpose(1, 2)
    recorded, ok = states[..., :3], recordings.ok[:, :, first::STEPS].transpose(1, 2)
    earlier = torch.cat([states[..., :2] - STEPS * STEP * states[..., 3:], states[..., 2:3]], dim=-1)
    poses, before = [recorded[:, 0]], [earlier[:, 0]]
    memory = states.new_zeros(*ok[:, 0].shape, model.config.size)
    targets, takens = [], []
    for moment in range(ok.shape[1]):
        goes_on = ok[:, moment] & (ok[:, moment + 1] if moment + 1 < ok.shape[1] else False)
        where = torch.nonzero(goes_on)
        group, number = where.unbind(dim=1)
        target, is_moved = torch.full(goes_on.shape, -1, device=ok.device), torch.zeros_like(goes_on)
        taken, after = target.clone(), recorded[:, min(moment + 1, ok.shape[1] - 1)].clone()
        if len(where):
            pose, kind = poses[-1][group, number], recordings.kind[group, number]
            wanted = after[group, number]
            misses = model.misses(kind, relative(pose, wanted))
            logits = torch.zeros_like(misses)
            if sees:
                scene = _scene(recordings, poses[-1], ok[:, moment], before[-1])
                there, sight = model.look(scene)
                a, b = there.unbind(dim=1)
                seen = model.remember(model.perceive(sight), memory[a, b])
                memory = torch.zeros_like(memory)
                memory[a, b] = seen
                row = torch.zeros(goes_on.shape, dtype=torch.long, device=ok.device)
                row[a, b] = torch.arange(len(there), device=ok.device)
                logits = model.decide(seen, sight)[row[group, number]]
            chosen = pick(moment, logits, misses)
            target[group, number], taken[group, number] = misses.argmin(dim=1), chosen
            ends = composed(pose, model.paths[kind, chosen, -1])
            is_near = (ends - wanted)[:, :2].norm(dim=1) <= lost
            after[group, number] = torch.where(is_near[:, None], ends, wanted)
            is_moved[group, number] = is_near
        targets.append(target)
        takens.append(taken)
        if moment + 1 < ok.shape[1]:
            before.append(torch.where(is_moved[..., None], poses[-1], earlier[:, moment + 1]))
            poses.append(after)
    return Rolled(
        torch.stack(poses, 1), torch.stack(before, 1), recorded, ok, torch.stack(targets, 1), torch.stack(takens, 1)
    )


def likelihood(model: TokenModel, recordings: Recordings, rolled: Rolled) -> Tensor:
    """Return log probabilities (N,) of the N tokens that lead to the recording, all moments at once."""
    count, moments, objects = rolled.ok.shape
    scene = _scene(recordings, *(values.flatten(0, 1) for values in (rolled.poses, rolled.ok, rolled.before)))
    where, sight = model.look(scene)
    group, number = where.unbind(dim=1)
    features = model.perceive(sight)
    batch, moment = group // moments, group % moments
    dense = features.new_zeros(moments, count, objects, features.shape[1])
    dense = dense.index_put((moment, batch, number), features)
    memory, seen = torch.zeros_like(dense[0]), []
    for now in range(moments):
        following = model.remember(dense[now].flatten(0, 1), memory.flatten(0, 1)).view_as(memory)
        memory = following * rolled.ok[:, now, :, None]
        seen.append(memory)
    logits = model.decide(torch.stack(seen)[moment, batch, number], sight)
    target = rolled.target.flatten(0, 1)[group, number]
    return logits[target >= 0].gather(1, target[target >= 0, None]).squeeze(1)


def _scene(recordings: Recordings, poses: Tensor, ok: Tensor, before: Tensor) -> TokenScene:
    """Moments of scenarios, as many of each, in order."""
    times = len(poses) // len(recordings.kind)
    build, kind = (values.repeat_interleave(times, dim=0) for values in (recordings.build, recordings.kind))
    on = torch.arange(len(recordings.kind), device=poses.device).repeat_interleave(times)
    return TokenScene(poses, ok, before, build, kind, recordings.pieces, on)


def nearest(noise: float, generator: torch.Generator) -> Pick:
    """Take the token nearest to the recording, or, of a share ``noise``, one of the ``NEAR`` nearest."""

    def pick(moment: int, logits: Tensor, misses: Tensor) -> Tensor:
        del moment, logits
        near = misses.topk(NEAR, dim=1, largest=False).indices
        draw = torch.randint(NEAR, (len(misses),), generator=generator).to(misses.device)
        is_off = (torch.rand(len(misses), generator=generator) < noise).to(misses.device)
        return near.gather(1, torch.where(is_off, draw, 0)[:, None]).squeeze(1)

    return pick


def nearest_of_probable(choices: int) -> Pick:
    """Take, of the most probable tokens, the one nearest to the recording."""

    def pick(moment: int, logits: Tensor, misses: Tensor) -> Tensor:
        del moment
        likely = logits.topk(choices, dim=1).indices
        return likely.gather(1, misses.gather(1, likely).argmin(dim=1, keepdim=True)).squeeze(1)

    return pick


def draw(logits: Tensor, share: float, chances: Tensor) -> Tensor:
    """Return tokens (R,) at places (R,) in [0, 1) of their distribution.

    Args:
        logits: (R, tokens) log probabilities.
        share: Only the most probable tokens that make up this share of all together are taken.
        chances: (R,) uniformly distributed numbers for a draw.
    """
    sorted_logits, order = logits.sort(dim=1, descending=True)
    weights = sorted_logits.exp()
    weights = weights.masked_fill(weights.cumsum(dim=1) - weights > share, 0.0)
    until = weights.cumsum(dim=1)
    number = (until <= chances[:, None] * until[:, -1:]).sum(dim=1).clamp(max=logits.shape[1] - 1)
    return order.gather(1, number[:, None]).squeeze(1)


def drawn(history: int, share: float, generator: torch.Generator) -> Pick:
    """Follow the recording for a number of moments, and then draw tokens."""

    def pick(moment: int, logits: Tensor, misses: Tensor) -> Tensor:
        if moment < history:
            return misses.argmin(dim=1)
        return draw(logits, share, torch.rand(len(logits), generator=generator).to(logits.device))

    return pick


def fit_tokens(
    run: FitRun,
    model: TokenModel,
    recordings: Recordings,
    tests: dict[str, Recordings],
    facts: Mapping[str, Any],
) -> None:
    """Train a model that has its tokens, on the device where it is; as ``scenarionet_data.learning.fitting.fit``."""
    config, count = model.config, len(recordings.kind)
    device = model.paths.device

    def batches(given: Recordings, order: Tensor) -> Iterator[Recordings]:
        for rows in order.split(config.batch_size):
            yield given.take(rows, device)

    def losses(epoch: int) -> Iterator[BatchLosses]:
        generator = torch.Generator().manual_seed(hash((run.seed, epoch)) % 2**32)
        pick = nearest_of_probable(config.choices) if config.choices else nearest(config.noise, generator)
        for batch in batches(recordings, torch.randperm(count, generator=generator)):
            first = int(torch.randint(STEPS, (), generator=generator))
            batch = batch.mirrored((torch.rand(len(batch.kind), generator=generator) < config.flip).to(device))
            with torch.no_grad():
                rolled = roll(model, batch, first, pick, sees=config.choices > 0, lost=config.lost)
            yield {"likelihood": -likelihood(model, batch, rolled).mean()}

    @torch.no_grad()
    def measure() -> dict[str, dict[str, float]]:
        model.eval()
        return {name: measured(model, batches(given, torch.arange(len(given.kind)))) for name, given in tests.items()}

    fit(run, model, config, count, losses, measure, facts)


@torch.no_grad()
def measured(model: TokenModel, scenes: Iterator[Recordings]) -> dict[str, float]:
    """Return what a model is worth on scenarios.

    Returns:
        ``likelihood``: mean negative log probability of the tokens of the recording. ``error``: mean distance between
        the corners of boxes that take the nearest tokens and the recording [m]. ``away``: mean distance from the
        recording in the 8 s after the first, when tokens are drawn [m].
    """
    generator = torch.Generator().manual_seed(0)
    values: dict[str, list[Tensor]] = {"likelihood": [], "error": [], "away": []}
    for batch in scenes:
        near = roll(model, batch, 0, nearest(0.0, generator), sees=False)
        values["likelihood"].append(-likelihood(model, batch, near))
        box = BOXES.to(near.poses.device)[batch.kind][:, None].expand(*near.ok.shape, 2)
        error = apart(corners(near.poses, box), corners(near.recorded, box))[:, 1:]
        values["error"].append(error[near.taken[:, :-1] >= 0])
        free = roll(model, batch, 0, drawn(2, 0.95, generator), sees=True)
        whole = free.ok[:, 2:3] & free.ok[:, 3:19]
        values["away"].append((free.poses - free.recorded)[:, 3:19, :, :2].norm(dim=-1)[whole])
    return {name: float(torch.cat(each).mean()) for name, each in values.items()}


def make_model(
    config: TokenConfig, recordings: Recordings, seed: int, device: torch.device, start: nn.Module | None = None
) -> TokenModel:
    """Return a model to train: with tokens of these recordings, or weights and tokens of another model."""
    torch.manual_seed(seed)
    model = TokenModel(config)
    if start is None:
        fill_tokens(model, recordings, torch.Generator().manual_seed(seed))
    else:
        model.load_state_dict(start.state_dict())
    model.to(device)
    return model


def load_tokens(files: LakeFiles, run: str) -> TokenModel:
    """Return the trained model of a run.

    Raises:
        LakeError: As :func:`scenarionet_data.learning.fitting.load_model`.
    """
    model, _ = load_model(files, run, TokenConfig, TokenModel)
    model.eval()
    return model
