"""Write the map of a scenario as CommonRoad's lanelets, traffic signs and lights."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Float64
from scenarionet_data.interchange.base import Losses
from scenarionet_data.interchange.commonroad.layout import (
    COLORS,
    CROSSWALK,
    LANE_OF_WORD,
    LANES,
    MARKS,
    SPEED,
    STATE_OF_COLOR,
    STOP,
)
from scenarionet_data.interchange.lane_graph import boundary_type
from scenarionet_data.interchange.lanelets import Lanelet
from scenarionet_data.scenario.description import MapFeatures, ScenarioDescription
from scenarionet_data.scenario.vocabulary import LIGHT_COLORS, LightColor, MapFeatureType, is_lane

_POINT = "<point><x>%.5f</x><y>%.5f</y></point>"


@dataclass
class _OfLanes:
    """What lanes refer to, by row of the map: numbers of signs and lights, and the text of a stop line."""

    signs: dict[int, list[int]] = field(default_factory=lambda: defaultdict(list))
    lights: dict[int, list[int]] = field(default_factory=lambda: defaultdict(list))
    stop_lines: dict[int, str] = field(default_factory=dict)


def write_map(
    scenario: ScenarioDescription,
    lanelets: list[Lanelet],
    numbers: Mapping[str, list[int]],
    free: Iterator[int],
    losses: Losses,
) -> list[str]:
    """Return the elements of the map of a scenario that has one.

    Args:
        scenario: The scenario.
        lanelets: Its lanes.
        numbers: Those of ``map features``, one for each lanelet, and of ``traffic lights``.
        free: Numbers for elements that have no id here.
        losses: Collects what the elements do not hold.
    """
    features = scenario.map
    if features is None:
        raise TypeError("a scenario without a map")
    number_of = {lanelet.row: number for lanelet, number in zip(lanelets, numbers["map features"], strict=True)}
    text = _OfLanes()
    crosswalks, after = list[str](), list[str]()
    row_of = {features.ids[row]: row for row in number_of}
    for row, kind in enumerate(features.feature_type):
        lanes = [row_of[each] for each in features.controlled_lanes[row] if each in row_of]
        if kind == MapFeatureType.STOP_SIGN and len(features.polyline[row]) and lanes:
            after.append(_sign(next(free), STOP, features.polyline[row][0], lanes, text))
        elif kind == MapFeatureType.STOP_LINE and len(features.polyline[row]) > 1 and lanes:
            _stop_line(features.polyline[row], lanes, text, losses)
        elif kind == MapFeatureType.CROSSWALK and len(features.polygon[row]) > 2:
            crosswalks.append(_crosswalk(next(free), features.polygon[row]))
            losses.leave_out("ids of crosswalks")
        elif not is_lane(np.array([kind]))[0]:
            losses.leave_out(f"map features of type {MapFeatureType(kind).name}")
    limits: dict[float, list[int]] = defaultdict(list)
    for row in number_of:
        if features.speed_limit[row] > 0 and np.isfinite(features.speed_limit[row]):
            limits[round(float(features.speed_limit[row]), 4)].append(row)
    for limit, rows in sorted(limits.items()):
        place = next(lanelet.right[0] for lanelet in lanelets if lanelet.row == rows[0])
        after.append(_sign(next(free), SPEED, place, rows, text, f"<additionalValue>{limit:.4f}</additionalValue>"))
    after += _lights(scenario, row_of, numbers["traffic lights"], text, losses)
    held = list(number_of)
    kinds = [LANE_OF_WORD[LANES[MapFeatureType(kind)]] for kind in features.feature_type[held]]
    losses.leave_out("kinds of lanes that CommonRoad does not have", int((features.feature_type[held] != kinds).sum()))
    beside = [each for lanelet in lanelets for each in (lanelet.on_left, lanelet.on_right) if each is not None]
    losses.leave_out(
        "neighbours that run in the opposite direction, which are told as such",
        sum(each.is_opposite for each in beside),
    )
    losses.leave_out(
        "that lanes are known to be no part of an intersection", int((features.is_intersection[held] == 0).sum())
    )
    lines = [line for lanelet in lanelets for line in _lanelet(features, lanelet, number_of, text)]
    return [*lines, *crosswalks, *after]


def _lanelet(features: MapFeatures, lanelet: Lanelet, number_of: Mapping[int, int], text: _OfLanes) -> Iterator[str]:
    row = lanelet.row
    yield f'<lanelet id="{number_of[row]}">'
    for tag, points, is_left in (("leftBound", lanelet.left, True), ("rightBound", lanelet.right, False)):
        mark = MARKS.get(boundary_type(features, row, is_left=is_left))  # type: ignore[arg-type]
        marking = f"<lineMarking>{mark}</lineMarking>" if mark else ""
        yield f"<{tag}>{_points(points)}{marking}</{tag}>"
    rest = [f'<predecessor ref="{number_of[other]}"/>' for other in lanelet.before]
    rest += [f'<successor ref="{number_of[other]}"/>' for other in lanelet.after]
    for tag, beside in (("adjacentLeft", lanelet.on_left), ("adjacentRight", lanelet.on_right)):
        if beside is not None:
            direction = "opposite" if beside.is_opposite else "same"
            rest.append(f'<{tag} ref="{number_of[beside.row]}" drivingDir="{direction}"/>')
    rest.append(text.stop_lines.get(row, ""))
    rest.append(f"<laneletType>{LANES[MapFeatureType(features.feature_type[row])]}</laneletType>")
    if features.is_intersection[row] == 1:
        rest.append("<laneletType>intersection</laneletType>")
    rest += [f'<trafficSignRef ref="{sign}"/>' for sign in text.signs.get(row, ())]
    rest += [f'<trafficLightRef ref="{light}"/>' for light in text.lights.get(row, ())]
    yield "".join(rest) + "</lanelet>"


def _points(points: Array) -> str:
    return "".join([_POINT % (x, y) for x, y in points[:, :2].tolist()])


def _position(point: Array) -> str:
    return f"<position>{_points(point[None])}</position>"


def _crosswalk(number: int, outline: Array) -> str:
    """A lanelet whose left side is the first half of the outline; with an odd number of points, the last is doubled."""
    points = outline if len(outline) % 2 == 0 else np.concatenate([outline, outline[-1:]])
    half = len(points) // 2
    return (
        f'<lanelet id="{number}"><leftBound>{_points(points[:half])}</leftBound>'
        f"<rightBound>{_points(points[half:][::-1])}</rightBound><laneletType>{CROSSWALK}</laneletType></lanelet>"
    )


def _sign(number: int, kind: str, place: Array, lanes: list[int], text: _OfLanes, value: str = "") -> str:
    for lane in lanes:
        text.signs[lane].append(number)
    return (
        f'<trafficSign id="{number}"><trafficSignElement><trafficSignID>{kind}</trafficSignID>{value}'
        f"</trafficSignElement>{_position(place)}<virtual>{str(bool(value)).lower()}</virtual></trafficSign>"
    )


def _stop_line(points: Array, lanes: list[int], text: _OfLanes, losses: Losses) -> None:
    """A stop line between its end points, of each of its lanes."""
    ends = points[[0, -1], :2].astype(np.float64)
    along = (ends[1] - ends[0]) / max(float(np.hypot(*(ends[1] - ends[0]))), 1e-9)
    off = points[:, :2] - ends[0]
    deviation = float(np.abs(off[:, 0] * along[1] - off[:, 1] * along[0]).max())
    losses.approximate("stop lines that are not straight", int(deviation > 1e-3), deviation, "m")
    losses.leave_out("stop lines of a lane beyond the first", sum(lane in text.stop_lines for lane in lanes))
    losses.leave_out("stop lines of several lanes, of which each has one", int(len(lanes) > 1))
    losses.leave_out("ids of stop lines")
    for lane in lanes:
        text.stop_lines.setdefault(lane, f"<stopLine>{_points(ends)}<lineMarking>solid</lineMarking></stopLine>")


def _lights(
    scenario: ScenarioDescription, row_of: Mapping[str, int], numbers: list[int], text: _OfLanes, losses: Losses
) -> Iterator[str]:
    """A light for each lane, with the recorded states as its cycle."""
    lights = scenario.lights
    for light, number in enumerate(numbers):
        lane = row_of.get(lights.lane_ids[light])
        if lane is None:
            losses.leave_out("traffic lights of lanes outside of the map")
            continue
        text.lights[lane].append(number)
        colors = LIGHT_COLORS[lights.state[light]]
        changes = [0, *(np.flatnonzero(np.diff(colors)) + 1).tolist(), len(colors)]
        cycle = "".join(
            f"<cycleElement><duration>{end - first}</duration><color>{COLORS[LightColor(colors[first])]}</color>"
            "</cycleElement>"
            for first, end in pairwise(changes)
        )
        stop: Float64 = lights.stop_point[light]
        place = _position(stop) if np.isfinite(stop[:2]).all() else ""
        yield f'<trafficLight id="{number}"><cycle>{cycle}</cycle>{place}</trafficLight>'
        kept = [STATE_OF_COLOR[COLORS[LightColor(color)]] for color in colors.tolist()]
        losses.leave_out(
            "kinds of states of traffic lights beyond their color", int((lights.state[light] != kept).sum())
        )
