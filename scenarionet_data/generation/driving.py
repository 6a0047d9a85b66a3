"""Make traffic with a trained model: place vehicles, and move them in windows for as long as wanted."""

from __future__ import annotations

from scenarionet_data.generation.snapshots import (  # first: says how to install torch
    LENGTH,
    TrafficMoments,
    is_inside,
)

# isort: split
from typing import NamedTuple

import numpy as np
import shapely
import torch
from torch import Tensor

from scenarionet_data.arrays.dtypes import Bool, Float32
from scenarionet_data.arrays.geometry import box_corners
from scenarionet_data.generation.frames import HEADING, X, Y
from scenarionet_data.generation.traffic_model import TrafficModel, from_lane

MARGIN = 0.2
"""How much longer and wider than vehicles the boxes are that must not touch [m]."""

WINDOW = 1.0
"""Time after which the motions of all vehicles are decided anew [s]."""

_TRIES = 10  # draws of a vehicle until it touches no other
_OFF_ROAD = 8.0  # distance from the middle of the nearest lane vector at which a vehicle has left the map [m]
_BORDER = 15.0  # from the edge of the crop inwards: where vehicles come later [m]


class Placed(NamedTuple):
    """Vehicles of B moments.

    Attributes:
        cars: (B, N, 6), those that were given first; ``ok`` (B, N).
        drawn, touched: Vehicles that were drawn first, and those of them that touch one that was there.
    """

    cars: Tensor
    ok: Tensor
    drawn: int
    touched: int


@torch.no_grad()
def place(
    model: TrafficModel,
    scenes: TrafficMoments,
    given: Tensor,
    number: Tensor,
    generator: torch.Generator,
    *,
    where: Tensor | None = None,
    may_touch: bool = False,
) -> Placed:
    """Place vehicles one after the other, each by what stands there already.

    Args:
        model: The model.
        scenes: B moments: their lanes, and the vehicles that may be given.
        given: (B, A) which vehicles are there already.
        number: (B,) vehicles to add to each.
        generator: Random numbers.
        where: (B, L) lane vectors that may be used; by default all within the crop.
        may_touch: Take every vehicle as it is drawn first. Otherwise one that touches another is drawn again, and left
            out if all draws touch.
    """
    around, most = model.map_features(scenes, scenes.lanes), int(number.max())
    cars = torch.cat([scenes.cars, torch.zeros(len(number), most, 6)], dim=1)
    ok = torch.cat([given, torch.zeros(len(number), most, dtype=torch.bool)], dim=1)
    first, rows = scenes.cars.shape[1], torch.arange(len(number))
    is_open = scenes.lane_ok & is_inside(scenes.lanes, model.config) & (True if where is None else where)
    weights = is_open.float()
    can = is_open.any(dim=1)
    drawn, touched, margin = 0, 0, 0.0 if may_touch else MARGIN
    for k in range(most):
        probabilities, features = model.cells(scenes.lanes, around, weights, cars, ok)
        chances = probabilities.exp() + 1e-12 * ~can[:, None]
        waiting = can & (number > k)
        for attempt in range(1 if may_touch else _TRIES):
            cell = torch.multinomial(chances, 1, generator=generator).squeeze(1)
            found = from_lane(scenes.lanes[rows, cell], model.mixture(features[rows, cell]).draw(generator))
            touches = torch.tensor([_touching(found[b], cars[b, ok[b]], margin) for b in rows.tolist()]) & waiting
            if attempt == 0:
                drawn, touched = drawn + int(waiting.sum()), touched + int(touches.sum())
            taken = waiting if may_touch else waiting & ~touches
            cars[taken, first + k], ok[taken, first + k] = found[taken], True
            waiting = waiting & ~taken
            if not waiting.any():
                break
    return Placed(cars, ok, drawn, touched)


class DrivenVehicles(NamedTuple):
    """N vehicles over T timesteps.

    Attributes:
        states: (N, T, 4) x, y, heading, speed in the frame of the scene.
        size: (N, 2) length and width.
        valid: (N, T), one run each.
    """

    states: Float32
    size: Float32
    valid: Bool


@torch.no_grad()
def drive(
    model: TrafficModel, scenes: TrafficMoments, cars: Tensor, steps: int, generator: torch.Generator
) -> DrivenVehicles:
    """Move vehicles (N, 6) on the map of one moment; for those that leave it, others come at the border of the crop.

    In each window, one vehicle after the other takes one of its motions, by their probabilities, that touches none of
    those before it; if all do, it brakes.

    Args:
        model: The model.
        scenes: One moment, whose lanes are the map.
        cars: Vehicles at the first timestep.
        steps: Timesteps after it.
        generator: Random numbers.
    """
    window, count, wanted = round(WINDOW / model.config.dt), len(cars), len(cars)
    edge = scenes.lanes[..., :2].abs().amax(dim=-1) > model.config.crop / 2 - _BORDER
    states, valid = [torch.zeros(count, steps + 1, 4)], [torch.zeros(count, steps + 1, dtype=torch.bool)]
    states[0][:, 0], valid[0][:, 0] = cars[:, :4], True
    everyone, is_there = cars.clone(), torch.ones(count, dtype=torch.bool)
    for start in range(0, steps, window):
        end = min(start + window, steps)
        all_states, all_valid = torch.cat(states), torch.cat(valid)
        now = everyone[is_there]
        if len(now):
            ahead = _choose(model, scenes, now, end - start, generator)
            all_states[is_there, start + 1 : end + 1], all_valid[is_there, start + 1 : end + 1] = ahead, True
            everyone[is_there, :4] = ahead[:, -1]
            away = torch.cdist(everyone[:, :2], scenes.lanes[0, scenes.lane_ok[0], :2]).amin(dim=1)
            is_there &= away < _OFF_ROAD
        states, valid = [all_states], [all_valid]
        if is_there.sum() < wanted and end < steps:
            there = scenes._replace(cars=everyone[None], car_ok=is_there[None])
            found = place(model, there, is_there[None], torch.tensor([1]), generator, where=edge)
            if found.ok[0, -1]:
                everyone, is_there = found.cars[0], found.ok[0]
                states.append(torch.zeros(1, steps + 1, 4))
                valid.append(torch.zeros(1, steps + 1, dtype=torch.bool))
                states[1][0, end], valid[1][0, end] = everyone[-1, :4], True
    return DrivenVehicles(torch.cat(states).numpy(), everyone[:, LENGTH:].numpy(), torch.cat(valid).numpy())


def _choose(
    model: TrafficModel, scenes: TrafficMoments, cars: Tensor, steps: int, generator: torch.Generator
) -> Tensor:
    """(N, steps, 4) one motion of each vehicle (N, 6)."""
    motions, logits = model.motions(cars[None], torch.ones(1, len(cars), dtype=torch.bool), scenes)
    ahead = torch.cat([motions[0], model.braking(cars)[:, None]], dim=1)
    count, modes = logits.shape[1:]
    drawn = torch.multinomial(logits[0].softmax(dim=-1) + 1e-9, modes, generator=generator)
    seen = ahead[:, :, ::2]
    boxes = _boxes(seen.numpy(), cars[:, None, None, LENGTH:].expand(*seen.shape[:3], 2).numpy(), MARGIN)
    now = _boxes(cars.numpy(), cars[:, LENGTH:].numpy(), 0.0)
    is_stuck = shapely.intersects(now[:, None], now)  # those that touch already must come apart
    taken, before = np.empty((count, seen.shape[2]), dtype=object), np.empty(count, np.intp)
    chosen = torch.empty(count, dtype=torch.long)
    for k, car in enumerate(torch.randperm(count, generator=generator).tolist()):
        touches = shapely.intersects(boxes[car][:, None], taken[None, :k]) & ~is_stuck[car, before[:k], None]
        touch = touches.any(axis=(1, 2))
        chosen[car] = next((mode for mode in drawn[car].tolist() if not touch[mode]), modes)
        taken[k], before[k] = boxes[car, chosen[car]], car
    return ahead[torch.arange(count), chosen, :steps]


def _touching(car: Tensor, others: Tensor, margin: float) -> bool:
    """Whether the box of a vehicle (6,) comes nearer than a margin [m] to that of one of others (n, 6)."""
    near = others[(others[:, :2] - car[:2]).norm(dim=1) < 15.0]
    both = torch.cat([car[None], near]).numpy()
    boxes = _boxes(both, both[:, LENGTH:], margin)
    return bool(shapely.intersects(boxes[0], boxes[1:]).any())


def _boxes(poses: Float32, size: Float32, margin: float) -> np.ndarray:
    """Polygons (...) of vehicles with poses (..., 3 or more) and sizes (..., 2), longer and wider by a margin [m]."""
    corners = box_corners(poses[..., [X, Y]], poses[..., HEADING], size[..., 0] + margin, size[..., 1] + margin)
    polygons: np.ndarray = shapely.polygons(corners)
    return polygons
