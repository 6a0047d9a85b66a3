"""Read the lanes of an Argoverse 1 vector map: each way with its tags and the points of its nodes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from xml.etree import ElementTree

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.building.plausible import find_bad_geometry
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
    points = np.array([[_number(node.get(axis)) for axis in "xy"] for node in root.iter("node")]).reshape(-1, 2)
    middle = np.nanmedian(points, axis=0) if np.isfinite(points).any() else np.zeros(2)
    lanes: dict[str, Argoverse1Lane] = {}
    centers = []
    for number, way in enumerate(root.iter("way"), start=1):
        try:
            lane = _lane(way)
            if lane.id in lanes:
                raise _BadLane("lane_id", "expected an id that no other lane has, found one again")
            centers.append(_center(way, points, rows, middle))
        except _BadLane as error:
            name = way.get("lane_id")
            defects.drop("maps", file, [f"lane {name}" if name else f"way {number}"], error.field, error.reason)
        else:
            lanes[lane.id] = lane
    lengths = [len(center) for center in centers]
    return list(lanes.values()), Ragged.from_flat(lengths, np.concatenate([np.zeros((0, 2)), *centers]))


def _number(text: str | None) -> float:
    """Parse a coordinate; NaN if it is missing or no number."""
    try:
        return float(text or "")
    except ValueError:
        return float("nan")


def _center(way: ElementTree.Element, points: Float64, rows: Mapping[str | None, int], middle: Float64) -> Float64:
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
    return center


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
