"""Read the JSON of Argoverse 2's map archives and leave out elements that cannot be used."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from scenarionet_data.building.plausible import MAX_MAP_DISTANCE
from scenarionet_data.errors import CorruptSource
from scenarionet_data.ingest.defects import Defects

Element = Mapping[str, Any]

_LANE = {
    "id": (int, str),
    "lane_type": (str,),
    "is_intersection": (bool,),
    "left_lane_mark_type": (str,),
    "right_lane_mark_type": (str,),
    "left_neighbor_id": (int, str, type(None)),
    "right_neighbor_id": (int, str, type(None)),
    "predecessors": (list,),
    "successors": (list,),
    "left_lane_boundary": (list,),
    "right_lane_boundary": (list,),
}
_FIELDS: dict[str, dict[str, tuple[type, ...]]] = {
    "lane_segments": _LANE,
    "drivable_areas": {"id": (int, str), "area_boundary": (list,)},
    "pedestrian_crossings": {"id": (int, str), "edge1": (list,), "edge2": (list,)},
}
"""Fields of the elements of each part of an archive, with their types."""
_LINES = {
    "lane_segments": ("left_lane_boundary", "right_lane_boundary", "centerline"),
    "drivable_areas": ("area_boundary",),
    "pedestrian_crossings": ("edge1", "edge2"),
}
"""Fields with points; centrelines are in some archives only."""
_MIN_POINTS = 2


class Archive:
    """The elements of a map archive that can be used.

    Args:
        path: The file.
        file: Its name relative to the raw folder.

    Attributes:
        defects: The other elements.

    Raises:
        CorruptSource: The file is missing, or not a map archive.
    """

    def __init__(self, path: Path, file: str) -> None:
        content = _read(path)
        self._path, self._file = path, file
        self.defects = Defects()
        self._parts: dict[str, dict[str, Element]] = {}
        for part in _FIELDS:
            elements = content.get(part) if isinstance(content, dict) else None
            if not isinstance(elements, dict):
                raise CorruptSource(
                    f"{path}: expected an Argoverse 2 map archive, found none of its {part}; download it again"
                )
            self._parts[part] = elements
            self._leave_out(part, _field_fault)
            known: set[str] = set()
            self._leave_out(part, partial(_repeated, known))
        lanes = self._parts["lane_segments"]
        if 2 * sum("centerline" in lane for lane in lanes.values()) > len(lanes):
            self._leave_out("lane_segments", lambda _, lane: None if "centerline" in lane else "expected a centerline")

    def elements(self, part: str) -> list[Element]:
        """Elements of a part of the archive.

        Raises:
            CorruptSource: There are no lanes.
        """
        if part == "lane_segments" and not self._parts[part]:
            raise CorruptSource(f"{self._path}: expected lanes, found no usable one; download it again")
        return list(self._parts[part].values())

    def leave_out_bad_lines(self) -> None:
        """Leave out elements with lines that cannot be used; takes longer than reading an archive without any."""
        for part in _FIELDS:
            self._leave_out(part, _line_fault)

    def _leave_out(self, part: str, fault_of: Callable[[str, Any], str | None]) -> None:
        for name, element in list(self._parts[part].items()):
            fault = fault_of(part, element)
            if fault:
                self.defects.drop("maps", self._file, [f"{part} {name}"], part, fault)
                del self._parts[part][name]


def _read(path: Path) -> Any:
    try:
        return json.loads(path.read_bytes())
    except FileNotFoundError as error:
        raise CorruptSource(f"{path}: no such map; download the folder it belongs to again") from error
    except OSError as error:
        raise CorruptSource(f"{path}: cannot be read ({error.strerror}); download it again") from error
    except (ValueError, RecursionError) as error:
        raise CorruptSource(
            f"{path}: expected an Argoverse 2 map archive, found other text than JSON; download it again"
        ) from error


def _field_fault(part: str, element: Any) -> str | None:
    """What is wrong with the fields of an element; None if nothing is."""
    if not isinstance(element, dict):
        return f"expected an element with fields, found {type(element).__name__}"
    for name, types in _FIELDS[part].items():
        if name not in element:
            return f"expected a field {name}, found none"
        if type(element[name]) not in types:
            wanted = " or ".join("null" if each is type(None) else each.__name__ for each in types)
            return f"expected {name} to be {wanted}, found {type(element[name]).__name__}"
    links = [*element["predecessors"], *element["successors"]] if part == "lane_segments" else []
    if not set(map(type, links)) <= {int, str}:
        return "expected ids of lanes as predecessors and successors, found others"
    return None


def _repeated(known: set[str], _part: str, element: Element) -> str | None:
    """A fault if the id of an element is known already; adds it."""
    identifier = str(element["id"])
    if identifier in known:
        return f"expected an id of its own, found {identifier!r} again"
    known.add(identifier)
    return None


def _line_fault(part: str, element: Element) -> str | None:
    """What is wrong with the lines of an element; None if nothing is."""
    for name in _LINES[part]:
        points = element.get(name, [{"x": 0, "y": 0, "z": 0}] * _MIN_POINTS)
        if not isinstance(points, list) or len(points) < _MIN_POINTS:
            number = len(points) if isinstance(points, list) else "none"
            return f"expected {name} to have at least {_MIN_POINTS} points, found {number}"
        for point in points:
            values: list[Any] = [point.get(axis) for axis in "xyz"] if isinstance(point, dict) else [None]
            if not all(type(value) in (int, float) and math.isfinite(value) for value in values):
                return f"expected {name} to have points of finite x, y and z, found {point!r:.80}"
            if max(map(abs, values)) > MAX_MAP_DISTANCE:
                return f"expected {name} within {MAX_MAP_DISTANCE:,.0f} m of the city's origin, found {point!r:.80}"
    return None
