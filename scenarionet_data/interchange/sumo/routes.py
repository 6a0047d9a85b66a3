"""Find the routes of recorded vehicles over a SUMO net."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import shapely

from scenarionet_data.interchange.base import Losses
from scenarionet_data.interchange.sumo.net_writer import Net, edge_id, is_bike_lane, lane_limit
from scenarionet_data.scenario.description import MapFeatures, ScenarioDescription
from scenarionet_data.scenario.vocabulary import ObjectType

_NEAR = 5.0  # [m] from a lane's centre, in which a vehicle drives on it
_ALONG = 0.8  # [rad]


def write_routes(scenario: ScenarioDescription, net: Net, names: Mapping[int, str], losses: Losses) -> bytes:
    """Return routes for SUMO's own drivers: each vehicle departs where and when it is first seen on a lane.

    Edges are those whose lanes it is on, joined by the shortest way (in edges) where it passed others. SUMO wants a
    departure at the limit at most, and vehicles other than bicycles off the lanes of these.
    """
    features = scenario.map
    if features is None:
        raise TypeError("a net without a map")
    tracks, lines = scenario.tracks, list[tuple[float, str]]()
    rows = [row for row in names if tracks.object_type[row] != ObjectType.PEDESTRIAN]
    losses.leave_out("routes of pedestrians", len(names) - len(rows))
    on_lane = _lanes(scenario, features, rows, net)
    for row in rows:
        states = on_lane[row]
        path = _joined([number for _, number, _, _ in states], net)
        if not path:
            losses.leave_out("routes of vehicles that are on no lane")
            continue
        step, number, place, station = states[0]
        speed = min(
            float(np.hypot(*tracks.velocity[row, step])), lane_limit(net.network.roads[number], place, features)
        )
        lane = len(net.network.roads[number].lanes) - 1 - place
        edges = " ".join(edge_id(net.network.roads[each]) for each in path)
        text = (
            f'<vehicle id="{names[row]}" type="type-{names[row]}" depart="{scenario.timestamps[step]:.3f}" '
            f'departLane="{lane}" departPos="{station:.2f}" departSpeed="{speed:.2f}">'
            f'<route edges="{edges}"/></vehicle>'
        )
        lines.append((scenario.timestamps[step], text))
    head = ['<?xml version="1.0" encoding="UTF-8"?>', "<routes>"]
    return "\n".join([*head, *(line for _, line in sorted(lines)), "</routes>\n"]).encode()


def _lanes(
    scenario: ScenarioDescription, features: MapFeatures, rows: list[int], net: Net
) -> dict[int, list[tuple[int, int, int, float]]]:
    """Timestep, road, place of the lane and station [m] of each object's states in which it drives along a lane."""
    tracks = scenario.tracks
    places = [key for key in net.lines if net.network.roads[key[0]].junction is None]
    lines = np.array([shapely.LineString(net.lines[key][:, :2]) for key in places])
    row, step = np.nonzero(tracks.valid[rows])
    row = np.array(rows, np.int64)[row]
    points = shapely.points(tracks.position[row, step, :2].astype(np.float64))
    state, lane = shapely.STRtree(lines).query(points, predicate="dwithin", distance=_NEAR)
    station = shapely.line_locate_point(lines[lane], points[state])
    ends = [shapely.line_interpolate_point(lines[lane], np.maximum(station + by, 0.0)) for by in (-0.5, 0.5)]
    along = shapely.get_coordinates(ends[1]) - shapely.get_coordinates(ends[0])
    turned = np.arctan2(along[:, 1], along[:, 0]) - tracks.heading[row[state], step[state]]
    away = shapely.distance(lines[lane], points[state])
    away[np.cos(turned) < np.cos(_ALONG)] = np.inf
    is_bike = np.array([is_bike_lane(net.network.roads[number], place, features) for number, place in places], np.bool_)
    away[is_bike[lane] & (tracks.object_type[row[state]] != ObjectType.CYCLIST)] = np.inf
    order = np.lexsort((away, state))
    first = order[np.append(True, np.diff(state[order]) > 0)] if len(order) else order
    found: dict[int, list[tuple[int, int, int, float]]] = {each: [] for each in rows}
    for k in first[np.isfinite(away[first])].tolist():
        found[int(row[state[k]])].append((int(step[state[k]]), *places[lane[k]], float(station[k])))
    return found


def _joined(numbers: list[int], net: Net) -> list[int]:
    """Roads one after the other; those that cannot be reached from the ones before are left out."""
    path = numbers[:1]
    for number in numbers:
        if number == path[-1]:
            continue
        before: dict[int, int] = {path[-1]: path[-1]}
        waiting = [path[-1]]
        while waiting and number not in before:
            waiting = [before.setdefault(other, road) and other for road in waiting
                       for other in net.after.get(road, ()) if other not in before]  # fmt: skip
        way = []
        while number in before and number != path[-1]:
            way.append(number)
            number = before[number]
        path += way[::-1]
    return path
