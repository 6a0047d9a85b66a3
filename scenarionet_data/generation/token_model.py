"""A network that says which token each road user takes next, from what it sees in its own frame.

After SMART (Wu et al. 2024, https://arxiv.org/abs/2405.15677): attention to the map and to other road users in relative
frames, before and after a memory of each road user's own past, here a recurrent unit. It sees no lights.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor, nn

from scenarionet_data.errors import BadParameter
from scenarionet_data.generation.frames import place, two_layers
from scenarionet_data.generation.tokens import BOXES, KINDS, STEP, STEPS, corners
from scenarionet_data.learning.fitting import FitConfig

LANE, LINE, EDGE = range(3)
"""Kinds of pieces of the map."""

NEAR = 8
"""Tokens that are near to the recording, when tokens are changed in training."""

_SPEED, _LENGTH, _WIDTH = 10.0, 5.0, 2.0  # scales of inputs


@dataclass(frozen=True)
class TokenConfig(FitConfig):
    """What a road user sees, by which network it chooses, and how that is trained.

    Attributes:
        tokens, radius: Largest number of tokens of a kind of road user; how far apart these are [m].
        heads: Of attention.
        near_lanes, near_lines, near_cars: Neighbours that are attended to.
        noise: Share of tokens in training that are not the nearest to the recording, but one of the ``NEAR`` nearest.
        flip: Share of scenarios that are mirrored in training.
        choices: Closed-loop training: of so many of the most probable tokens, the nearest to the recording is taken
            (CAT-K, Zhang et al. 2025, https://arxiv.org/abs/2412.05334); 0 for behaviour cloning.
        lost: Training: who comes further than this from the recording is put back on it [m]; to come back from 1 m
            within a token takes 8 m/s², which is not to be learned.

    Raises:
        BadParameter: Settings do not go together.
    """

    kind = "token model"
    command = "scenarionet traffic learn --kind tokens"
    uses_gpu = True

    tokens: int = 2048
    radius: float = 0.07
    size: int = 96
    heads: int = 4
    near_lanes: int = 16
    near_lines: int = 8
    near_cars: int = 8
    batch_size: int = 2
    noise: float = 0.1
    flip: float = 0.5
    choices: int = 0
    lost: float = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        least = max(NEAR, self.choices)
        if self.tokens < least:
            raise BadParameter(f"tokens: wanted at least {least}, as many as choices, found {self.tokens}")


class TokenScene(NamedTuple):
    """G groups of road users, each at one moment on one map: metres, radians, metres per second.

    Attributes:
        poses: (G, A, 3); ``ok`` (G, A) which of them there are.
        before: (G, A, 3) poses a token earlier, or where they were at their speed if they were not there.
        build: (G, A, 2) length and width.
        kind: (G, A) of ``tokens.KINDS``.
        pieces: (M, P, 5) middle, heading, length and kind of pieces of M maps, -1 for none.
        on: (G,) the map of each.
    """

    poses: Tensor
    ok: Tensor
    before: Tensor
    build: Tensor
    kind: Tensor
    pieces: Tensor
    on: Tensor


class Sight(NamedTuple):
    """What R road users see: features of k neighbours, which of them there are, and rows of the road users among them.

    Attributes:
        own: (R, 8) of themselves.
        road: (R, k, 10); ``road_ok`` (R, k).
        others: (R, k, 12); ``others_ok`` (R, k); ``rows`` (R, k) of 0 ... R-1.
        kind: (R,).
    """

    own: Tensor
    road: Tensor
    road_ok: Tensor
    others: Tensor
    others_ok: Tensor
    rows: Tensor
    kind: Tensor


class Attention(nn.Module):
    """Lets each row attend to its neighbours, whose keys and values are made of features in its frame."""

    def __init__(self, size: int, heads: int, features: int) -> None:
        super().__init__()
        self.norm, self.heads = nn.LayerNorm(size), heads
        self.query, self.source, self.out = nn.Linear(size, size), nn.Linear(size, 2 * size), nn.Linear(size, size)
        self.edge = two_layers(features, 2 * size, size // 2)
        self.feed = nn.Sequential(nn.LayerNorm(size), two_layers(size, size, 2 * size))

    def forward(self, x: Tensor, edges: Tensor, ok: Tensor, rows: Tensor | None = None) -> Tensor:
        """Return x (R, size) after attention to neighbours (R, k, features), which may be rows of x themselves."""
        seen, keys = self.norm(x), self.edge(edges)
        if rows is not None:
            keys = keys + self.source(seen)[rows]
        key, value = keys.unflatten(-1, (2, self.heads, -1)).unbind(dim=-3)
        query = self.query(seen).unflatten(-1, (self.heads, -1))
        weight = torch.einsum("rhd,rkhd->rhk", query, key) * query.shape[-1] ** -0.5
        weight = weight.masked_fill(~ok[:, None], -1e9).softmax(dim=-1) * ok[:, None]
        x = x + self.out(torch.einsum("rhk,rkhd->rhd", weight, value).flatten(1))
        return x + self.feed(x)


class TokenModel(nn.Module):
    """Chooses tokens.

    Attributes:
        paths: (kinds, tokens, STEPS, 3) motions of tokens in the frame of their beginning.
        has_token: (kinds, tokens) which of them there are: all others are never chosen.
    """

    paths: Tensor
    has_token: Tensor

    def __init__(self, config: TokenConfig) -> None:
        super().__init__()
        size, kinds, self.config = config.size, len(KINDS), config
        self.register_buffer("paths", torch.zeros(kinds, config.tokens, STEPS, 3))
        self.register_buffer("has_token", torch.zeros(kinds, config.tokens, dtype=torch.bool))
        self.own = two_layers(5 + kinds, size)
        self.road = nn.ModuleList(Attention(size, config.heads, 10) for _ in range(2))
        self.others = nn.ModuleList(Attention(size, config.heads, 9 + kinds) for _ in range(2))
        self.memory = nn.GRUCell(size, size)
        self.norm = nn.LayerNorm(size)
        self.logit = nn.ModuleList(nn.Linear(size, config.tokens) for _ in range(kinds))

    def look(self, scene: TokenScene) -> tuple[Tensor, Sight]:
        """Return group and number (R, 2) of the road users there are, and what each of them sees."""
        where = torch.nonzero(scene.ok)
        group, number = where.unbind(dim=1)
        poses, kind = scene.poses[group, number], scene.kind[group, number]
        moved = place(poses, scene.before[group, number, None])[:, 0]
        build = scene.build[group, number] / torch.tensor([_LENGTH, _WIDTH], device=poses.device)
        is_kind = nn.functional.one_hot(kind, len(KINDS)).float()
        speed = (scene.poses - scene.before)[..., :2].norm(dim=-1) / (STEPS * STEP)
        row_of = torch.zeros(scene.ok.shape, dtype=torch.long, device=poses.device)
        row_of[group, number] = torch.arange(len(where), device=poses.device)
        own = torch.cat([moved[:, [2, 3, 5]], build, is_kind], dim=-1)

        away = torch.cdist(scene.poses[..., :2], scene.poses[..., :2])[group, number]
        alone = torch.arange(scene.ok.shape[1], device=poses.device) == number[:, None]
        least, which = _least(away.masked_fill(~scene.ok[group] | alone, torch.inf), self.config.near_cars)
        rows = row_of[group[:, None], which]
        others = torch.cat(
            [place(poses, poses[rows]), speed[group[:, None], which, None] / _SPEED, build[rows], is_kind[rows]], dim=-1
        )
        ahead = speed[group, number, None].clamp(min=5.0) * torch.stack([poses[:, 2].cos(), poses[:, 2].sin()], dim=-1)
        on = scene.on[group]
        middle, of = scene.pieces[..., :2][on], scene.pieces[..., 4][on]
        found = []
        for count, centre, is_seen in (
            (self.config.near_lanes, poses[:, :2] + ahead, of == LANE),
            (self.config.near_lines, poses[:, :2] + 0.5 * ahead, of > LANE),
        ):
            far = (middle - centre[:, None]).norm(dim=-1)
            found.append(_least(far.masked_fill(~is_seen, torch.inf), count))
        far, which_piece = (torch.cat(each, dim=1) for each in zip(*found, strict=True))
        pieces = scene.pieces[on[:, None], which_piece]
        types = nn.functional.one_hot(pieces[..., 4].long().clamp(min=0), 3)
        road = torch.cat([place(poses, pieces), pieces[..., 3:4] / _LENGTH, types], dim=-1)
        return where, Sight(own, road, torch.isfinite(far), others, torch.isfinite(least), rows, kind)

    def perceive(self, sight: Sight) -> Tensor:
        """Return features (R, size) of the moment."""
        x = self.road[0](self.own(sight.own), sight.road, sight.road_ok)
        features: Tensor = self.others[0](x, sight.others, sight.others_ok, sight.rows)
        return features

    def remember(self, features: Tensor, memory: Tensor) -> Tensor:
        """Return the next memory (R, size) of road users; zeros are no memory."""
        remembered: Tensor = self.memory(features, memory)
        return remembered

    def decide(self, features: Tensor, sight: Sight) -> Tensor:
        """Return log probabilities (R, tokens) from features of the moment together with the memory (R, size)."""
        x = self.road[1](features, sight.road, sight.road_ok)
        x = self.norm(self.others[1](x, sight.others, sight.others_ok, sight.rows))
        logits = x.new_zeros(len(x), self.config.tokens)
        for kind, layer in enumerate(self.logit):
            is_kind = sight.kind == kind
            logits[is_kind] = layer(x[is_kind]).masked_fill(~self.has_token[kind], -1e9)
        return logits.log_softmax(dim=-1)

    def misses(self, kind: Tensor, wanted: Tensor) -> Tensor:
        """Return how far the end of each token of road users is from poses (R, 3) in their frames: (R, tokens) [m].

        That is the root of the mean square of the distances of the corners, which is a product of matrices.
        """
        boxes = BOXES.to(wanted.device)
        away = wanted.new_full((len(kind), self.config.tokens), torch.inf)
        for number, box in enumerate(boxes):
            is_kind, count = kind == number, int(self.has_token[number].sum())
            ends = corners(self.paths[number, :count, -1], box.expand(count, 2)).flatten(1)
            where = corners(wanted[is_kind], box.expand(int(is_kind.sum()), 2)).flatten(1)
            away[is_kind.nonzero(), torch.arange(count, device=kind.device)] = torch.cdist(where, ends) / 2
        return away


def _least(away: Tensor, count: int) -> tuple[Tensor, Tensor]:
    least, which = away.topk(min(count, away.shape[-1]), dim=-1, largest=False)
    return least, which
