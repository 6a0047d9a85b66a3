"""Read the lanelets of a CommonRoad file as map features."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from xml.etree.ElementTree import Element

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.building import MapBuilder
from scenarionet_data.building.plausible import find_bad_geometry
from scenarionet_data.converters.formats.xml_files import to_number
from scenarionet_data.ingest.defects import Defects
from scenarionet_data.interchange.commonroad.layout import CROSSWALK, LANE_OF_WORD, MARK_OF_WORD, SPEED, STOP
from scenarionet_data.scenario.vocabulary import MapFeatureType

_SIGNS_TO_STOP = (STOP, "R1-1", "r2")


def read_map(root: Element, shift: Float64, file: str, defects: Defects) -> MapBuilder:
    """Read the map of a file; what cannot be used is left out and listed in ``defects``.

    Args:
        root: The file.
        shift: (3,) from its frame to the source frame [m].
        file: Its name, for ``defects``.
        defects: Collects what is left out.
    """
    builder, lanelets = MapBuilder(), _lanelets(root, shift, file, defects)
    lanes = {name: kind for name, (kind, *_) in lanelets.items() if kind is not None}
    limits, stops = _signs(root, shift)
    marks, stopped = list[tuple[str, MapFeatureType, Float64]](), defaultdict(list)
    for name, (kind, element, left, right) in lanelets.items():
        if kind is None:
            outline = np.concatenate([left, right[::-1]])
            is_other = np.append(True, np.abs(np.diff(outline, axis=0)).max(axis=1) > 0.0)
            builder.add(name, MapFeatureType.CROSSWALK, polygon=outline[is_other])
            continue
        beside: dict[str, list[str]] = {}
        for tag in ("adjacentLeft", "adjacentRight"):
            same = (each for each in element.findall(tag) if each.get("drivingDir") == "same")
            beside[tag] = [ref for ref in _references(same) if ref in lanes and ref != name]
        bounds: dict[str, list[str]] = {"leftBound": [], "rightBound": []}
        for tag, line in (("leftBound", left), ("rightBound", right)):
            mark = MARK_OF_WORD.get((element.findtext(f"{tag}/lineMarking") or "").strip())
            if mark is not None:
                marks.append((f"{name}-{tag.removesuffix('Bound')}", mark, line))
                bounds[tag] = [marks[-1][0]]
        linked = {tag: _references(element.findall(tag)) for tag in ("predecessor", "successor")}
        unknown = [f"{name} to {ref[:64]}" for refs in linked.values() for ref in refs if ref not in lanes]
        defects.drop("maps", file, unknown, "links", f"expected lanelets of the file, found {', '.join(unknown[:1])}")
        signs = _references(element.findall("trafficSignRef"))
        for sign in signs:
            stopped[sign].append(name)
        words = _words(element)
        half = 0.5 * np.hypot(*(left - right)[:, :2].T)
        own_limit = to_number(element.findtext("speedLimit"))  # of 2018b
        builder.add(
            name,
            kind,
            polyline=0.5 * (left + right),
            polygon=np.concatenate([left, right[::-1]]),
            width=np.column_stack([half, half]),
            speed_limit=min((limits[sign] for sign in signs if sign in limits), default=own_limit),
            entry_lanes=[ref for ref in linked["predecessor"] if ref in lanes],
            exit_lanes=[ref for ref in linked["successor"] if ref in lanes],
            left_neighbors=beside["adjacentLeft"],
            right_neighbors=beside["adjacentRight"],
            left_boundaries=bounds["leftBound"],
            right_boundaries=bounds["rightBound"],
            is_intersection=True if "intersection" in words else None,
        )
        ends = points_of(element.find("stopLine"), shift)
        if len(ends) == 2 and np.isfinite(ends).all():
            builder.add(f"stop-{name}", MapFeatureType.STOP_LINE, polyline=ends, controlled_lanes=[name])
    for key, mark, line in marks:
        builder.add(key, mark, polyline=line)
    for sign, place in stops.items():
        builder.add(sign, MapFeatureType.STOP_SIGN, polyline=place, controlled_lanes=stopped[sign])
    return builder


def _lanelets(
    root: Element, shift: Float64, file: str, defects: Defects
) -> dict[str, tuple[MapFeatureType | None, Element, Float64, Float64]]:
    """Type (None for crosswalks), element, left and right side (P, 3) [m] of each lanelet that can be used."""
    found: dict[str, tuple[MapFeatureType | None, Element, Float64, Float64]] = {}
    middle: Float64 | None = None
    for element in root.findall("lanelet"):
        name, words = element.get("id", ""), _words(element)
        left, right = (points_of(element.find(tag), shift) for tag in ("leftBound", "rightBound"))
        kinds = [LANE_OF_WORD[word] for word in words if word in LANE_OF_WORD]
        reason = ""
        if not name or name in found:
            reason = f"expected an id of its own, found {name[:64] or 'none'}"
        elif len(left) != len(right) or len(left) < 2:
            reason = f"expected as many points on both sides, two at least, found {len(left)} and {len(right)}"
        elif words and not kinds and CROSSWALK not in words:
            reason = f"expected lanes and crosswalks, found {', '.join(words)[:64]}"
        else:
            sides = np.concatenate([left, right])
            middle = sides[0, :2] if middle is None and np.isfinite(sides).all() else middle
            reason = find_bad_geometry(sides, sides[0, :2] if middle is None else middle) or ""
        if reason:
            defects.drop("maps", file, [f"lanelet {name[:64]}"], "lanelet", reason)
        else:
            kind = kinds[0] if kinds else MapFeatureType.LANE_SURFACE_STREET
            found[name] = None if CROSSWALK in words else kind, element, left, right
    return found


def _signs(root: Element, shift: Float64) -> tuple[dict[str, float], dict[str, Float64]]:
    """Speed limits [m/s] and places (1, 3) [m] of stop signs, by number."""
    limits, stops = dict[str, float](), dict[str, Float64]()
    for sign in root.findall("trafficSign"):
        name = sign.get("id", "")
        for element in sign.findall("trafficSignElement"):
            kind, place = (element.findtext("trafficSignID") or "").strip(), points_of(sign.find("position"), shift)
            value = to_number(element.findtext("additionalValue"))
            if kind.startswith(SPEED) and 0.0 < value < 150.0:
                limits[name] = value
            elif kind in _SIGNS_TO_STOP and len(place) == 1 and np.isfinite(place).all():
                stops[name] = place
    return limits, stops


def _words(element: Element) -> list[str]:
    return [(each.text or "").strip() for each in element.findall("laneletType")]


def _references(elements: Iterable[Element]) -> list[str]:
    return [each.get("ref", "") for each in elements]


def points_of(element: Element | None, shift: Float64 | float = 0.0) -> Float64:
    """Return the points (P, 3) below an element [m], NaN for what is no number."""
    points = [] if element is None else element.findall("point")
    values = [[to_number(point.findtext(axis)) for axis in "xy"] + [0.0] for point in points]
    return np.array(values).reshape(-1, 3) + shift
