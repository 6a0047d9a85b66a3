"""Two networks that make traffic: one places vehicles on lane vectors, one after the other, one moves them.

Both see the lane vectors and vehicles nearest to a frame, in its own coordinates, so that what they learn on one map
holds on another. Placement follows TrafficGen (Feng et al. 2023, https://arxiv.org/abs/2210.06609): which lane vector
has the next vehicle, then where on it, how fast and how large, as mixtures of normal distributions. Motions are
accelerations and curvatures at knots, from which a bicycle model makes paths; vehicles see no traffic lights.
"""

from __future__ import annotations

from scenarionet_data.generation.snapshots import (  # first: says how to install torch
    LENGTH,
    SPEED,
    WIDTH,
    TrafficConfig,
    TrafficMoments,
    is_inside,
)

# isort: split
import math
from typing import NamedTuple

import torch
from torch import Tensor, nn

from scenarionet_data.generation.frames import HEADING, X, Y, place, relative, two_layers

_SPEED, _LENGTH, _WIDTH = 10.0, 5.0, 2.0  # scales of inputs
_MEAN = torch.tensor([0.0, 0.0, 0.0, 4.0, 4.6, 1.9])
_SPREAD = torch.tensor([1.5, 0.5, 0.2, 4.0, 0.8, 0.2])
"""Of the attributes on a lane vector: along, to the left [m], heading, speed, length and width."""

_APART = 6.0, 2.2
"""Distances along and across at which one vehicle does not hinder another [m]."""

_BRAKING, _CURVATURE = 5.0, 0.25
"""Largest acceleration [m/s^2] and curvature [1/m] of a motion."""

KNOTS = 5
"""Controls of a motion, evenly spaced over its time and interpolated."""


class NeighbourEncoder(nn.Module):
    """Features of what is near some frames, each the maximum over its nearest neighbours."""

    def __init__(self, size: int, near_lanes: int, near_cars: int) -> None:
        super().__init__()
        self.lane, self.car = two_layers(7, size, size // 2), two_layers(9, size, size // 2)
        self.near_lanes, self.near_cars = near_lanes, near_cars

    def lanes(self, frames: Tensor, lanes: Tensor, ok: Tensor) -> Tensor:
        """Return (B, Q, size) features of the lane vectors (B, L, 4) near frames (B, Q, 3)."""
        found, is_there = _nearest(frames, lanes, ok, self.near_lanes)
        return _pooled(self.lane(torch.cat([place(frames, found), found[..., 3:] / _LENGTH], dim=-1)), is_there)

    def cars(self, frames: Tensor, cars: Tensor, ok: Tensor, *, are_own: bool = False) -> Tensor:
        """Return (B, Q, size) features of the vehicles (B, A, 6) near frames, which may be those of the vehicles."""
        found, is_there = _nearest(frames, cars, ok, self.near_cars, are_own=are_own)
        return _pooled(self.car(torch.cat([place(frames, found), _build(found)], dim=-1)), is_there)


class Mixture(NamedTuple):
    """Standardised attributes of vehicles, see :func:`to_lane`, as K normal distributions.

    Attributes:
        weight: (..., K) log probabilities.
        mean, spread: (..., K, 6) means, and logarithms of standard deviations.
    """

    weight: Tensor
    mean: Tensor
    spread: Tensor

    def log_prob(self, attributes: Tensor) -> Tensor:
        """Return the log densities of attributes (..., 6)."""
        away = (attributes[..., None, :] - self.mean) / self.spread.exp()
        each = -0.5 * away.square() - self.spread - 0.5 * math.log(2 * math.pi)
        return (self.weight + each.sum(dim=-1)).logsumexp(dim=-1)

    def draw(self, generator: torch.Generator) -> Tensor:
        """Draw attributes (B, 6) of B vehicles."""
        which = torch.multinomial(self.weight.exp(), 1, generator=generator).squeeze(-1)
        rows = torch.arange(len(which))
        mean, spread = self.mean[rows, which], self.spread[rows, which].exp()
        return mean + spread * torch.randn(mean.shape, generator=generator)


class TrafficModel(nn.Module):
    """Places vehicles, and moves them."""

    def __init__(self, config: TrafficConfig) -> None:
        super().__init__()
        size, self.config = config.size, config
        self.near_lane = NeighbourEncoder(size, config.near_lanes, config.near_cars)
        self.local = two_layers(2 * size + 2, size)
        self.whole = two_layers(size, size)
        self.cell = two_layers(2 * size, size)
        self.logit, self.repulsion = nn.Linear(size, 1), nn.Parameter(torch.tensor(10.0))
        self.attributes = nn.Linear(size, config.components * 13)
        self.near_car = NeighbourEncoder(size, 2 * config.near_lanes, config.near_cars)
        self.motion = nn.Sequential(
            two_layers(2 * size + 3, 2 * size), nn.ReLU(), nn.Linear(2 * size, config.modes * (2 * KNOTS + 1))
        )
        part = torch.linspace(0, KNOTS - 1, config.num_future)
        weights = (1 - (part[:, None] - torch.arange(KNOTS)).abs()).clamp(min=0.0)
        self.register_buffer("weights", weights, persistent=False)

    def map_features(self, scenes: TrafficMoments, queries: Tensor) -> Tensor:
        """Return (B, Q, size) features of the map around lane vectors (B, Q, 4), which stay as vehicles come."""
        return self.near_lane.lanes(queries[..., :3], scenes.lanes, scenes.lane_ok)

    def cells(
        self, queries: Tensor, around: Tensor, weights: Tensor, cars: Tensor, is_placed: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Return where the next vehicle comes.

        Args:
            queries: (B, Q, 4) lane vectors.
            around: (B, Q, size) their :meth:`map_features`.
            weights: (B, Q) for how many lane vectors each stands; 0 for one that cannot be chosen.
            cars: (B, A, 6) vehicles.
            is_placed: (B, A) which of them are there already.

        Returns:
            (B, Q) log probabilities of lane vectors and (B, Q, size) their features, for :meth:`mixture`.
        """
        near = self.near_lane.cars(queries[..., :3], cars, is_placed)
        away = queries[..., :2].norm(dim=-1, keepdim=True) / self.config.crop
        count = (is_placed.sum(dim=1) / 20.0)[:, None, None].expand_as(away)
        local = self.local(torch.cat([around, near, away, count], dim=-1)).relu()
        share = weights / weights.sum(dim=1, keepdim=True).clamp(min=1e-6)
        whole = (share[..., None] * self.whole(local)).sum(dim=1, keepdim=True)
        features = self.cell(torch.cat([local, whole.expand_as(local)], dim=-1)).relu()
        logits = self.logit(features).squeeze(-1) - self.repulsion * _occupied(queries, cars, is_placed)
        total = torch.logsumexp(logits + weights.clamp(min=1e-30).log(), dim=1, keepdim=True)
        return (logits - total).masked_fill(weights == 0, -1e9), features

    def mixture(self, features: Tensor) -> Mixture:
        """Return the attributes of a vehicle on a lane vector from its features (..., size)."""
        weight, mean, spread = (
            self.attributes(features).unflatten(-1, (self.config.components, 13)).split((1, 6, 6), -1)
        )
        return Mixture(weight.squeeze(-1).log_softmax(dim=-1), mean, spread.clamp(-3.0, 2.0))

    def motions(self, cars: Tensor, ok: Tensor, scenes: TrafficMoments) -> tuple[Tensor, Tensor]:
        """Return (B, A, K, F, 4) x, y, heading, speed to come of vehicles (B, A, 6), and (B, A, K) logits."""
        ahead = cars[..., SPEED].clamp(min=5.0)  # [m]: the lanes that matter are about a second away
        centre = (
            cars[..., :3]
            + torch.stack([cars[..., HEADING].cos(), cars[..., HEADING].sin(), 0 * ahead], -1) * ahead[..., None]
        )
        lanes = self.near_car.lanes(centre, scenes.lanes, scenes.lane_ok)
        others = self.near_car.cars(cars[..., :3], cars, ok, are_own=True)
        out = self.motion(torch.cat([lanes, others, _build(cars)], dim=-1)).unflatten(-1, (self.config.modes, -1))
        controls = self.weights @ out[..., 1:].unflatten(-1, (KNOTS, 2))
        return self._driven(cars[:, :, None], controls), out[..., 0]

    def braking(self, cars: Tensor) -> Tensor:
        """Return (..., F, 4) what vehicles (..., 6) do that brake as hard as they can, straight on."""
        return self._driven(cars, torch.tensor([-10.0, 0.0]).expand(*cars.shape[:-1], self.config.num_future, 2))

    def _driven(self, cars: Tensor, controls: Tensor) -> Tensor:
        """Integrate accelerations and curvatures (..., F, 2) from vehicles (..., 6)."""
        dt = self.config.dt
        accelerations, curvatures = _BRAKING * controls[..., 0].tanh(), _CURVATURE * controls[..., 1].tanh()
        speed = (cars[..., SPEED, None] + dt * accelerations.cumsum(dim=-1)).clamp(min=0.0)
        heading = cars[..., HEADING, None] + dt * (curvatures * speed).cumsum(dim=-1)
        x = cars[..., X, None] + dt * (speed * heading.cos()).cumsum(dim=-1)
        y = cars[..., Y, None] + dt * (speed * heading.sin()).cumsum(dim=-1)
        return torch.stack([x, y, heading, speed], dim=-1)


def to_lane(lanes: Tensor, cars: Tensor) -> Tensor:
    """Return the attributes of vehicles (..., 6) on lane vectors (..., 4), standardised."""
    return (torch.cat([relative(lanes, cars), cars[..., SPEED:]], dim=-1) - _MEAN) / _SPREAD


def from_lane(lanes: Tensor, attributes: Tensor) -> Tensor:
    """Return vehicles (..., 6) from standardised attributes on lane vectors (..., 4), within what vehicles can be."""
    along, left, turn, speed, length, width = (attributes * _SPREAD + _MEAN).unbind(dim=-1)
    along = torch.maximum(torch.minimum(along, lanes[..., 3] / 2), -lanes[..., 3] / 2)
    cos, sin = lanes[..., HEADING].cos(), lanes[..., HEADING].sin()
    x, y = lanes[..., X] + along * cos - left * sin, lanes[..., Y] + along * sin + left * cos
    heading = lanes[..., HEADING] + turn.clamp(-torch.pi / 2, torch.pi / 2)
    return torch.stack([x, y, heading, speed.clamp(min=0.0), length.clamp(min=1.5), width.clamp(min=0.7)], dim=-1)


def placement_loss(model: TrafficModel, scenes: TrafficMoments, generator: torch.Generator) -> Tensor:
    """Return how improbable the vehicles of moments are, given a random part of them.

    Any order of the vehicles is as good as another: the next one is each of those that are left alike.
    """
    known, cell = scenes.car_ok & (scenes.cell >= 0), scenes.cell.clamp(min=0)
    rank = torch.rand(known.shape, generator=generator).masked_fill(~known, 2.0).argsort(dim=1).argsort(dim=1)
    count = known.sum(dim=1)
    given = (torch.rand(len(count), generator=generator) * count).long()
    is_placed = known & (rank < given[:, None])
    is_next = known & ~is_placed
    queries, weights, place = _chosen_lanes(model, scenes, known, cell, generator)
    around = model.map_features(scenes, queries)
    probabilities, features = model.cells(queries, around, weights, scenes.cars, is_placed)
    share = is_next / is_next.sum(dim=1, keepdim=True).clamp(min=1)
    where = -(probabilities.gather(1, place) * share).sum(dim=1)
    rows, which = torch.nonzero(is_next, as_tuple=True)
    lanes, found = scenes.lanes[rows, cell[rows, which]], model.mixture(features[rows, place[rows, which]])
    return where.mean() - found.log_prob(to_lane(lanes, scenes.cars[rows, which])).mean()


def _chosen_lanes(
    model: TrafficModel, scenes: TrafficMoments, known: Tensor, cell: Tensor, generator: torch.Generator
) -> tuple[Tensor, Tensor, Tensor]:
    """(B, Q, 4) lane vectors with vehicles and some of the others, for how many each stands, and (B, A) places there.

    The others stand for all those that are left out, so that the sum over them is right on average.
    """
    is_open = scenes.lane_ok & is_inside(scenes.lanes, model.config)
    is_used = torch.zeros_like(is_open).scatter_reduce(1, cell, known, "amax")
    order = torch.rand(is_open.shape, generator=generator) + 2.0 * is_used + 1.0 * is_open
    chosen = order.topk(min(model.config.queries, order.shape[1]), dim=1).indices
    used, free = is_used.gather(1, chosen), (is_open & ~is_used).gather(1, chosen)
    left_out = (is_open & ~is_used).sum(dim=1, keepdim=True) / free.sum(dim=1, keepdim=True).clamp(min=1)
    place_of = torch.zeros(is_open.shape, dtype=torch.long).scatter(
        1, chosen, torch.arange(chosen.shape[1]).expand_as(chosen)
    )
    queries = scenes.lanes.gather(1, chosen[..., None].expand(-1, -1, 4))
    return queries, used + free * left_out, place_of.gather(1, cell)


def motion_loss(model: TrafficModel, scenes: TrafficMoments, generator: torch.Generator) -> Tensor:
    """Distance of the closest motion from the recorded one [m], and how probable it was found to be.

    Vehicles start beside their recorded states, so that the network learns to come back.
    """
    noise = torch.randn((*scenes.cars.shape[:2], 4), generator=generator) * model.config.noise
    moved = scenes.cars[..., :4] + noise * torch.tensor([1.0, 1.0, 0.1, 1.0])
    cars = torch.cat([moved[..., :3], moved[..., 3:].clamp(min=0.0), scenes.cars[..., LENGTH:]], dim=-1)
    motions, logits = model.motions(cars, scenes.car_ok, scenes)
    distance = (motions[..., :2] - scenes.path[:, :, None]).norm(dim=-1)
    count = scenes.path_ok.sum(dim=-1)
    mean = (distance * scenes.path_ok[:, :, None]).sum(dim=-1) / count.clamp(min=1)[..., None]
    best, mode = mean.min(dim=-1)
    each = best + 0.3 * nn.functional.cross_entropy(
        logits.flatten(0, 1), mode.detach().flatten(), reduction="none"
    ).view_as(best)
    is_known = scenes.car_ok & (count > 0)
    return (each * is_known).sum() / is_known.sum().clamp(min=1)


def _occupied(queries: Tensor, cars: Tensor, is_placed: Tensor) -> Tensor:
    """(B, Q) how much of a vehicle in the middle of lane vectors another one takes away: 1 all of it, 0 nothing."""
    x, y, _ = relative(queries[:, :, None], cars[:, None]).unbind(dim=-1)
    gap = torch.maximum(x.abs() / _APART[0], y.abs() / _APART[1])
    return (1.0 - gap).clamp(min=0.0).masked_fill(~is_placed[:, None], 0.0).amax(dim=2)


def _nearest(frames: Tensor, others: Tensor, ok: Tensor, count: int, *, are_own: bool = False) -> tuple[Tensor, Tensor]:
    """(B, Q, count, ...) the others nearest to each frame, and which of them there are; not itself if it is one."""
    with torch.no_grad():
        away = torch.cdist(frames[..., :2], others[..., :2]).masked_fill(~ok[:, None], torch.inf)
        if are_own:
            away = away.masked_fill(torch.eye(away.shape[-1], dtype=torch.bool), torch.inf)
        least, which = away.topk(min(count, away.shape[-1]), dim=-1, largest=False)
    return others[torch.arange(len(others))[:, None, None], which], torch.isfinite(least)


def _build(cars: Tensor) -> Tensor:
    """(..., 3) scaled speed, length and width."""
    return torch.stack([cars[..., SPEED] / _SPEED, cars[..., LENGTH] / _LENGTH, cars[..., WIDTH] / _WIDTH], dim=-1)


def _pooled(features: Tensor, is_there: Tensor) -> Tensor:
    """(B, Q, size) maximum over k neighbours (B, Q, k, size) of those that are there; 0 without any."""
    if not is_there.all():
        features = features.where(is_there[..., None], -1e3)
    return features.max(dim=2).values.relu()
