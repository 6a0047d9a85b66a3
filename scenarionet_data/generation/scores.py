"""How like the recorded vehicles those are that a model places, beside vehicles that are placed without a model."""

from __future__ import annotations

from scenarionet_data.generation.driving import place  # first: says how to install torch

# isort: split
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import torch
from torch import Tensor

from scenarionet_data.arrays.dtypes import Array, Float64
from scenarionet_data.errors import BadParameter
from scenarionet_data.generation.discrepancy import discrepancy
from scenarionet_data.generation.frames import HEADING, X, Y
from scenarionet_data.generation.snapshots import (
    LENGTH,
    SPEED,
    WIDTH,
    TrafficConfig,
    TrafficMoments,
    is_inside,
    read_moments,
)
from scenarionet_data.generation.traffic_model import TrafficModel
from scenarionet_data.generation.training import load
from scenarionet_data.query.lake_view import LakeView

ATTRIBUTES = ("position", "heading", "speed", "size")
_BATCH = 32
_RESAMPLES = 2000


@dataclass(frozen=True)
class PlacementScore:
    """Discrepancies from the recorded vehicles, means over the moments.

    Attributes:
        name: Who placed the vehicles.
        means: By attribute: position [m], heading [rad], velocity [m/s] and size [m] in the frame of the ego.
        differences: By attribute: how much higher it is than the model's, with a 95 % interval over the scenarios.
        moments, vehicles: How many were compared.
        touching: Share of vehicles that touch one that was placed before, as they were drawn first.
    """

    name: str
    means: dict[str, float]
    differences: dict[str, tuple[float, float, float]] = field(default_factory=dict)
    moments: int = 0
    vehicles: int = 0
    touching: float | None = None


def score_placement(lake: LakeView, run: str, database: str, *, seed: int = 0) -> list[PlacementScore]:
    """Compare vehicles that a model places with the recorded ones, at all moments of a database.

    The ego is given, and the model places as many others as are recorded on lanes within the crop. Beside it stand the
    vehicles of a random moment on another map, and vehicles placed uniformly (anywhere on the lanes, along them, with
    speed, length and width anywhere between the smallest and the largest of the database).

    Args:
        lake: The lake.
        run: The training run.
        database: Database with scenarios of at least two maps.
        seed: Seed of the draws.

    Raises:
        LakeError: The run cannot be loaded, see :func:`.training.load`.
        BadParameter: No moment shows enough vehicles, or all scenarios have the same map.
    """
    model = load(lake, run)
    scenes, ids = read_moments(lake, database, model.config)
    rows = torch.nonzero(torch.tensor([len(each) > 0 for each in _others(scenes)])).squeeze(1)
    scenes, names = scenes.take(rows), np.array(ids)[rows.numpy()]
    table = lake.sql("SELECT scenario_id, coalesce(map_id, scenario_id) AS map FROM metadata")
    map_of = dict(zip(table["scenario_id"], table["map"], strict=True))
    maps = np.array([map_of[each] for each in names])
    if len(set(maps)) < 2:
        raise BadParameter(
            f"{database}: all moments are on one map; vehicles of other maps, with which the model is compared, need "
            "a database with scenarios of at least two"
        )
    recorded = _others(scenes)
    rng, generator = np.random.default_rng(seed), torch.Generator().manual_seed(seed)
    counts = np.array([len(each) for each in recorded])
    drawn, touching = _placed(model, scenes, counts, generator)
    everyone = np.concatenate(recorded)

    def borrowed(may_lend: Callable[[int], Array]) -> list[Array]:
        return [_some(recorded[rng.choice(np.flatnonzero(may_lend(k)))], counts[k], rng) for k in range(len(recorded))]

    sets = {
        run: drawn,
        "another map": borrowed(lambda k: maps != maps[k]),
        "uniform": [
            _uniform(scenes.take(torch.tensor([k])), counts[k], everyone, model.config, rng)
            for k in range(len(recorded))
        ],
    }
    values = {name: _discrepancies(found, recorded) for name, found in sets.items()}
    scores = []
    for name, each in values.items():
        differences = {
            attribute: _interval(each[:, k] - values[run][:, k], names, rng) for k, attribute in enumerate(ATTRIBUTES)
        }
        means = dict(zip(ATTRIBUTES, each.mean(axis=0).tolist(), strict=True))
        share = touching if name == run else None
        scores.append(PlacementScore(name, means, differences, len(recorded), int(counts.sum()), share))
    return scores


def _others(scenes: TrafficMoments) -> list[Array]:
    """Recorded vehicles on lanes in the crop but the ego, of each moment."""
    known = scenes.car_ok & (scenes.cell >= 0)
    known[:, 0] = False
    return [scenes.cars[k, known[k]].numpy() for k in range(len(known))]


def _placed(
    model: TrafficModel, scenes: TrafficMoments, counts: Array, generator: torch.Generator
) -> tuple[list[Array], float]:
    """Vehicles of each moment, and the share that touch one another where nothing is drawn again."""
    found: list[Array] = []
    drawn = touched = 0
    for rows in torch.arange(len(counts)).split(_BATCH):
        part, number = scenes.take(rows), torch.from_numpy(counts)[rows]
        given: Tensor = torch.zeros_like(part.car_ok)
        given[:, 0] = True
        raw = place(model, part, given, number, generator, may_touch=True)
        drawn, touched = drawn + raw.drawn, touched + raw.touched
        placed = place(model, part, given, number, generator)
        first = part.cars.shape[1]
        found += [placed.cars[k, first:][placed.ok[k, first:]].numpy() for k in range(len(rows))]
    return found, touched / max(drawn, 1)


def _some(cars: Array, count: int, rng: np.random.Generator) -> Array:
    return cars[rng.choice(len(cars), count, replace=len(cars) < count)]


def _uniform(
    scene: TrafficMoments, count: int, everyone: Array, config: TrafficConfig, rng: np.random.Generator
) -> Array:
    """Vehicles anywhere on the lanes of a moment."""
    lanes = scene.lanes[0][scene.lane_ok[0] & is_inside(scene.lanes[0], config)].numpy()
    chosen = lanes[rng.choice(len(lanes), count, p=lanes[:, 3] / lanes[:, 3].sum(dtype=np.float64))]
    along = (rng.random(count) - 0.5) * chosen[:, 3]
    low, high = everyone.min(axis=0), everyone.max(axis=0)
    rest = low[SPEED:] + rng.random((count, 3)) * (high - low)[SPEED:]
    x = chosen[:, X] + along * np.cos(chosen[:, HEADING])
    y = chosen[:, Y] + along * np.sin(chosen[:, HEADING])
    return np.column_stack([x, y, chosen[:, HEADING], rest])


def _discrepancies(placed: list[Array], recorded: list[Array]) -> Float64:
    """(n, 4) of each moment, by attribute."""
    return np.array(
        [
            [discrepancy(a, b) for a, b in zip(_values(mine), _values(theirs), strict=True)]
            for mine, theirs in zip(placed, recorded, strict=True)
        ]
    )


def _values(cars: Array) -> tuple[Array, ...]:
    """Position, heading in [0, 2 pi), velocity and size, as TrafficGen compares them."""
    heading = cars[:, HEADING].astype(np.float64)
    velocity = cars[:, SPEED, None] * np.stack([np.cos(heading), np.sin(heading)], axis=1)
    return cars[:, : Y + 1], np.mod(heading, 2 * np.pi)[:, None], velocity, cars[:, LENGTH : WIDTH + 1]


def _interval(values: Float64, names: Array, rng: np.random.Generator) -> tuple[float, float, float]:
    """Mean with a 95 % interval: scenarios, each with all its moments, are drawn again."""
    _, which = np.unique(names, return_inverse=True)
    sums, counts = np.bincount(which, values), np.bincount(which)
    rows = rng.integers(len(sums), size=(_RESAMPLES, len(sums)))
    means = sums[rows].sum(axis=1) / counts[rows].sum(axis=1)
    low, high = np.quantile(means, (0.025, 0.975))
    return float(values.mean()), float(low), float(high)
