"""Read the lanes of an Argoverse 1 vector map: each way with its tags and the points of its nodes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from xml.etree import ElementTree

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64, Int64
from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.building.plausible import find_bad_geometry
from scenarionet_data.building.polylines import directions
from scenarionet_data.converters.formats.xml_files import to_number
from scenarionet_data.ingest.defects import Defects

_BOOLEANS = {"True": True, "False": False}


@dataclass
class Argoverse1Lane:
    """A way of the file with its tags."""

    id: str
    tags: dict[str, str]
    entries: list[str]
    exits: list[str]

    def is_true(self, key: str) -> bool:
        """Parse a tag that is True or False."""
        return _BOOLEANS[self.tags[key]]

    def neighbor(self, key: str) -> str | None:
        """Parse a tag that is a lane or None."""
        found = self.tags[key]
        return None if found == "None" else str(int(found))


class _BadLane(Exception):
    """A lane that cannot be read.

    Attributes:
        field: The field at fault.
        reason: What was expected and found.
    """

    def __init__(self, field: str, reason: str) -> None:
        super().__init__(reason)
        self.field, self.reason = field, reason


def read_lanes(root: ElementTree.Element, file: str, defects: Defects) -> tuple[list[Argoverse1Lane], Ragged]:
    """Return the lanes of a map, and their centrelines as points (P, 2) float64 [m]; unreadable ones are dropped.

    Args:
        root: The root of the file.
        file: Its name, for ``defects``.
        defects: Collects the lanes that are dropped.
    """
    rows = {node.get("id"): row for row, node in enumerate(root.iter("node"))}
    points = np.array([[to_number(node.get(axis)) for axis in "xy"] for node in root.iter("node")]).reshape(-1, 2)
    middle = np.nanmedian(points, axis=0) if np.isfinite(points).any() else np.zeros(2)
    lanes: dict[str, Argoverse1Lane] = {}
    centers = []
    for number, way in enumerate(root.iter("way"), start=1):
        try:
            lane = _lane(way)
            if lane.id in lanes:
                raise _BadLane("lane_id", "expected an id that no other lane has, found one again")
            names = [reference.get("ref") for reference in way.iter("nd")]
            missing = [name for name in names if name not in rows]
            if missing:
                raise _BadLane("nd", f"expected nodes of the file, found {missing[0]}")
            if len(names) < 2:
                raise _BadLane("nd", f"expected at least 2 nodes, found {len(names)}")
            center: Float64 = points[[rows[name] for name in names]]
            reason = find_bad_geometry(center, middle)
            if reason:
                raise _BadLane("node", reason)
            centers.append(center)
        except _BadLane as error:
            name = way.get("lane_id")
            defects.drop("maps", file, [f"lane {name}" if name else f"way {number}"], error.field, error.reason)
        else:
            lanes[lane.id] = lane
    lengths = [len(center) for center in centers]
    return list(lanes.values()), Ragged.from_flat(lengths, np.concatenate([np.zeros((0, 2)), *centers]))


def _lane(way: ElementTree.Element) -> Argoverse1Lane:
    lane = Argoverse1Lane(_whole_number("lane_id", way.get("lane_id")), {}, [], [])
    lists = {"predecessor": lane.entries, "successor": lane.exits}
    for tag in way.iter("tag"):
        key, value = tag.get("k", ""), tag.get("v", "")
        if key not in lists:
            lane.tags[key] = value
        elif value != "None":
            lists[key].append(_whole_number(key, value))
    for key in ("is_intersection", "has_traffic_control"):
        if lane.tags.get(key) not in _BOOLEANS:
            raise _BadLane(key, f"expected True or False, found {lane.tags.get(key, 'none')}")
    for key in ("l_neighbor_id", "r_neighbor_id"):
        if lane.tags.get(key) != "None":
            _whole_number(key, lane.tags.get(key))
    return lane


def _whole_number(key: str, text: str | None) -> str:
    """Parse an id."""
    try:
        return str(int(text or ""))
    except ValueError as error:
        raise _BadLane(key, f"expected the number of a lane, found {text or 'none'}") from error


_ASIDE = 0.5
"""Minimum lateral distance of a neighbour for its side to be determined from geometry [m]."""


@dataclass
class LaneNeighbors:
    """Neighbours of a lane, left and right in its driving direction.

    Attributes:
        left, right: Lanes of either direction.
        opposite: Neighbours in the opposite direction.
        moved: Those that the source lists on the other side.
    """

    left: list[str] = field(default_factory=list)
    right: list[str] = field(default_factory=list)
    opposite: list[str] = field(default_factory=list)
    moved: list[str] = field(default_factory=list)


def sort_sides(
    neighbors: Sequence[tuple[str | None, str | None]], known: Mapping[str, int], centers: Ragged
) -> list[LaneNeighbors]:
    """Sort neighbours by geometry; keep the side of those outside the map.

    Args:
        neighbors: Left and right neighbour of each lane in the source.
        known: Row of each lane of the map.
        centers: Centrelines, points (P, 2) [m].
    """
    sorted_sides = [LaneNeighbors() for _ in neighbors]
    told = [(row, name, side) for row, pair in enumerate(neighbors) for side, name in enumerate(pair) if name]
    inside = [(row, name, side) for row, name, side in told if name in known]
    lanes, others = np.array([(row, known[name]) for row, name, _ in inside], np.int64).reshape(-1, 2).T
    aside, is_opposite = _beside(centers, lanes, others)
    for row, name, side in told:
        if name not in known:
            _put(sorted_sides[row], name, side)
    for (row, name, side), offset, is_against in zip(inside, aside.tolist(), is_opposite.tolist(), strict=True):
        sides = sorted_sides[row]
        lies = side if abs(offset) < _ASIDE else int(offset < 0)
        _put(sides, name, lies)
        if is_against:
            sides.opposite.append(name)
        if lies != side:
            sides.moved.append(name)
    return sorted_sides


def _put(sides: LaneNeighbors, name: str, side: int) -> None:
    chosen = sides.right if side else sides.left
    if name not in chosen:
        chosen.append(name)


def _beside(centers: Ragged, lanes: Int64, others: Int64) -> tuple[Float64, Bool]:
    """Lateral offset of another lane at the middle of a lane [m], positive to the left, and whether it is opposite."""
    if not len(lanes):
        return np.zeros(0), np.zeros(0, np.bool_)
    direction = directions(centers)
    middle = centers.offsets[lanes] + centers.lengths[lanes] // 2
    there = centers.take(others)
    away = there.values - np.repeat(centers.values[middle], there.lengths, axis=0)
    distance = np.hypot(away[:, 0], away[:, 1])
    lowest = np.repeat(np.minimum.reduceat(distance, there.offsets[:-1]), there.lengths)
    candidates = np.flatnonzero(distance == lowest)
    nearest = candidates[np.searchsorted(candidates, there.offsets[:-1])]
    ahead = direction[middle]
    ahead_there = direction[nearest - there.offsets[:-1] + centers.offsets[others]]
    aside = ahead[:, 0] * away[nearest, 1] - ahead[:, 1] * away[nearest, 0]
    return aside, (ahead * ahead_there).sum(axis=1) < 0
