"""Paths that the ego could take: all ways along the lanes from where it is first seen, as Waymax's ``sdc_paths``."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.interchange.base import Losses
from scenarionet_data.interchange.scenes import TrainingScene
from scenarionet_data.scenario.description import MapFeatures
from scenarionet_data.scenario.vocabulary import is_lane

NUM_PATHS, NUM_POINTS = 45, 800
"""Paths and points of a path in Waymax's default configuration."""

_SPACING = 0.5  # [m] as between Waymo's points of lanes
_BESIDE = 4.0  # [m] from the ego to the centre of a lane, so that lanes beside its own are begun, too
_ON_ROUTE = 3.0  # [m] from the path to where the recording ends
_MAX_WAYS = 4 * NUM_PATHS


@dataclass(frozen=True, eq=False)
class _Lane:
    """A lane: its number, points (P, 3) [m], and the lanes it leads to."""

    number: int
    points: Float64
    exits: tuple[int, ...]

    def arcs(self) -> Float64:
        """Return the distance of each point along the lane [m]."""
        return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(self.points[:, :2], axis=0).T))])


def find_paths(
    features: MapFeatures | None, scene: TrainingScene, shift: Float64, losses: Losses
) -> dict[str, NDArray[Any]]:
    """Return the features ``path_samples/…`` of Waymax's examples, padded with -1.

    A path begins beside the ego where it is first seen, on a lane of its direction, and follows exits for up to 400 m;
    it is on the route where it passes by the end of the recording. Those along the recording come first.

    Args:
        features: The map.
        scene: The scenario's objects, with roads in the source frame.
        shift: (3,) added to positions [m].
        losses: Collects what does not fit.
    """
    xyz = np.full((NUM_PATHS, NUM_POINTS, 3), -1.0)
    number, arc = np.full((NUM_PATHS, NUM_POINTS), -1), np.full((NUM_PATHS, NUM_POINTS), -1.0)
    valid, on_route = np.zeros((NUM_PATHS, NUM_POINTS), np.int64), np.zeros((NUM_PATHS, 1), np.int64)
    seen = scene.position[scene.ego][scene.valid[scene.ego]]
    direction = scene.heading[scene.ego][scene.valid[scene.ego]][0]
    lanes = {} if features is None else _lanes(features, scene)
    paths: list[tuple[bool, Float64, NDArray[np.int64]]] = []
    for begin, way in _ways(lanes, seen, direction):
        points, numbers = _sample([lanes[row] for row in way], begin)
        off = np.hypot(*(points[:, :2] - seen[-1, :2]).T).min()
        paths.append((bool(off <= _ON_ROUTE), points, numbers))
    paths.sort(key=lambda path: not path[0])
    losses.leave_out("paths of the ego beyond 45", max(len(paths) - NUM_PATHS, 0))
    losses.leave_out("routes of egos, along which no lanes lead", int(not any(path[0] for path in paths)))
    for row, (is_on_route, points, numbers) in enumerate(paths[:NUM_PATHS]):
        count = len(points)
        xyz[row, :count], number[row, :count], valid[row, :count] = points + shift, numbers, 1
        arc[row, :count], on_route[row] = np.arange(count) * _SPACING, is_on_route
    return {
        "path_samples/xyz": xyz,
        "path_samples/id": number,
        "path_samples/valid": valid,
        "path_samples/arc_length": arc,
        "path_samples/on_route": on_route,
    }


def _lanes(features: MapFeatures, scene: TrainingScene) -> Mapping[int, _Lane]:
    """Return lanes by their row in the map."""
    kept = {row: (number, points) for row, number, points in scene.roads if len(points) > 1}
    rows = [row for row in kept if is_lane(features.feature_type[row])]
    row_of = {features.ids[row]: row for row in rows}
    return {
        row: _Lane(*kept[row], tuple(row_of[each] for each in features.exit_lanes[row] if each in row_of))
        for row in rows
    }


def _ways(lanes: Mapping[int, _Lane], seen: Float64, direction: float) -> Iterator[tuple[float, list[int]]]:
    """Yield where a way begins on its first lane [m], and its lanes; ways near the recording come first."""
    away = {row: float(np.hypot(*(lane.points[::4, None, :2] - seen[::10, :2]).T).min()) for row, lane in lanes.items()}
    ahead, begins = np.array([np.cos(direction), np.sin(direction)]), dict[int, float]()
    for row, lane in lanes.items():
        steps, from_start = np.diff(lane.points[:, :2], axis=0), seen[0, :2] - lane.points[:-1, :2]
        squares = np.maximum((steps**2).sum(axis=1), 1e-12)
        along = np.clip((from_start * steps).sum(axis=1) / squares, 0.0, 1.0)
        apart = np.hypot(*(from_start - along[:, None] * steps).T)
        apart[steps @ ahead <= 0.0] = np.inf
        nearest = int(apart.argmin())
        if apart[nearest] <= _BESIDE:
            begins[row] = float(lane.arcs()[nearest] + along[nearest] * np.sqrt(squares[nearest]))
    waiting = [(begin, [row]) for row, begin in sorted(begins.items(), key=lambda item: -away[item[0]])]
    found, longest = 0, (NUM_POINTS - 1) * _SPACING
    while waiting and found < _MAX_WAYS:
        begin, way = waiting.pop()
        length = sum(float(lanes[row].arcs()[-1]) for row in way) - begin
        exits = [row for row in lanes[way[-1]].exits if row not in way] if length < longest else []
        if not exits:
            found += 1
            yield begin, way
        waiting += [(begin, [*way, row]) for row in sorted(exits, key=lambda row: -away[row])]


def _sample(way: list[_Lane], begin: float) -> tuple[Float64, NDArray[np.int64]]:
    """Return points (P, 3) every 0.5 m along lanes, from ``begin`` on, and the number of the lane of each."""
    points = np.concatenate([lane.points for lane in way])
    numbers = np.repeat([lane.number for lane in way], [len(lane.points) for lane in way])
    arcs = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points[:, :2], axis=0).T))])
    count = min(NUM_POINTS, int((arcs[-1] - begin) / _SPACING) + 1)
    wanted = begin + np.arange(count) * _SPACING
    sampled = np.column_stack([np.interp(wanted, arcs, points[:, axis]) for axis in range(3)])
    return sampled, numbers[np.minimum(np.searchsorted(arcs, wanted, side="right") - 1, len(numbers) - 1)]
