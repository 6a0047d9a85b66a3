"""Read a SUMO net: lanes, links, neighbours, limits and the programs of traffic lights."""

from __future__ import annotations

from collections import defaultdict
from xml.etree.ElementTree import Element

import numpy as np

from scenarionet_data.arrays.dtypes import Float64, UInt8
from scenarionet_data.building import MapBuilder
from scenarionet_data.building.plausible import find_bad_geometry
from scenarionet_data.converters.formats.xml_files import to_number
from scenarionet_data.ingest.defects import Defects
from scenarionet_data.scenario.vocabulary import LightState, MapFeatureType

_WIDTH = 3.2  # [m] SUMO's default
_NO_ROADS = frozenset({"pedestrian", "tram", "rail_urban", "rail", "rail_electric", "rail_fast", "ship", "subway"})
_STATES = {
    **dict.fromkeys("Gg", LightState.LANE_STATE_GO),
    **dict.fromkeys("ru", LightState.LANE_STATE_STOP),
    "y": LightState.LANE_STATE_CAUTION,
}


def read_net(root: Element, shift: Float64, file: str, defects: Defects) -> tuple[MapBuilder, dict[str, Float64]]:
    """Read the lanes of a net, and the end of each (3,) [m]; what cannot be used is left out and listed in ``defects``.

    Args:
        root: The net.
        shift: (3,) from its frame to the source frame [m].
        file: Its name, for ``defects``.
        defects: Collects what is left out.
    """
    lanes: dict[str, tuple[Element, Float64, bool, bool]] = {}
    beside: dict[str, tuple[list[str], list[str]]] = {}
    middle: Float64 | None = None
    for edge in root.findall("edge"):
        if edge.get("function", "internal") not in ("internal", "normal"):
            continue  # crossings and walking areas
        kept = []
        for lane in edge.findall("lane"):
            name, allowed = lane.get("id", ""), set((lane.get("allow") or "").split())
            if allowed and allowed <= _NO_ROADS:
                continue
            line = _points(lane.get("shape", "")) + shift
            middle = line[0, :2] if middle is None and len(line) and np.isfinite(line).all() else middle
            reason = "expected an id of its own, found it twice or none" if not name or name in lanes else ""
            if len(line) < 2:
                reason = f"expected two points or more, found {len(line)}"
            reason = reason or find_bad_geometry(line, np.zeros(2) if middle is None else middle) or ""
            if reason:
                defects.drop("maps", file, [f"lane {name[:64]}"], "lane", reason)
                continue
            is_for_bikes = bool(allowed) and allowed <= {"bicycle", "pedestrian"}
            lanes[name] = lane, line, edge.get("function") == "internal", is_for_bikes
            kept.append(name)
        for place, name in enumerate(kept):  # from right to left
            beside[name] = kept[place + 1 : place + 2], kept[place - 1 : place] if place else []
    after, before, missing = defaultdict(list), defaultdict(list), []
    for link in root.findall("connection"):
        start = f"{link.get('from')}_{link.get('fromLane')}"
        end = link.get("via") or f"{link.get('to')}_{link.get('toLane')}"
        if start in lanes and end in lanes:
            after[start].append(end)
            before[end].append(start)
        elif not {start, end} & lanes.keys():
            missing.append(f"{start[:64]} to {end[:64]}")
    reason = f"expected lanes of the net, found {', '.join(missing[:1])}"
    defects.drop("maps", file, missing, "connection", reason)
    builder = MapBuilder()
    for name, (lane, line, is_inside, is_for_bikes) in lanes.items():
        width, speed = to_number(lane.get("width")), to_number(lane.get("speed"))
        half = 0.5 * (width if 0.1 < width < 50.0 else _WIDTH)
        builder.add(
            name,
            MapFeatureType.LANE_BIKE_LANE if is_for_bikes else MapFeatureType.LANE_SURFACE_STREET,
            polyline=line,
            width=[[half, half]],
            speed_limit=speed if 0.0 < speed < 150.0 else np.nan,
            entry_lanes=list(dict.fromkeys(before[name])),
            exit_lanes=list(dict.fromkeys(after[name])),
            left_neighbors=beside[name][0],
            right_neighbors=beside[name][1],
            is_intersection=is_inside,
        )
    return builder, {name: line[-1] for name, (_, line, _, _) in lanes.items()}


def read_lights(root: Element, times: Float64) -> dict[str, UInt8]:
    """Return the states (T,) of lanes with a light at times (T,) [s], by the net's static programs.

    Of a lane with several links it is the light of the first.
    """
    programs: dict[str, Element] = {}
    for program in root.findall("tlLogic"):
        if program.get("type") == "static":
            programs.setdefault(program.get("id", ""), program)
    found: dict[str, UInt8] = {}
    for link in root.findall("connection"):
        lane, index = f"{link.get('from')}_{link.get('fromLane')}", to_number(link.get("linkIndex"))
        chosen = programs.get(link.get("tl", ""))
        if chosen is None or lane in found or not 0 <= index < 10_000:
            continue
        phases = chosen.findall("phase")
        ends = np.cumsum([to_number(phase.get("duration")) for phase in phases])
        offset = to_number(chosen.get("offset", "0"))
        words = [phase.get("state", "") for phase in phases]
        if not len(ends) or not np.isfinite([*ends, offset]).all() or (np.diff(ends, prepend=0.0) <= 0).any():
            continue
        codes = [_STATES.get(word[int(index) : int(index) + 1], LightState.LANE_STATE_UNKNOWN) for word in words]
        place = np.searchsorted(ends, (times - offset + 1e-6) % ends[-1], side="right").clip(max=len(ends) - 1)
        found[lane] = np.array(codes, np.uint8)[place]
    return found


def _points(text: str) -> Float64:
    """Points (P, 3) of ``x,y x,y,z ...`` [m], NaN for what is no number."""
    points = [[to_number(value) for value in point.split(",")[:3]] for point in text.split()]
    return np.array([point + [np.nan] * (2 - len(point)) + [0.0] * (len(point) < 3) for point in points]).reshape(-1, 3)
