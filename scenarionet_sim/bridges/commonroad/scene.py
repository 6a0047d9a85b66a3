"""A world as CommonRoad's objects in memory: lanelets, obstacles with forecasts, a planning problem, the road's edge.

Needs commonroad-io, commonroad-drivability-checker and shapely. Timesteps are counted from now on: now is 0.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import shapely
from commonroad.common.util import Interval
from commonroad.geometry.shape import Rectangle
from commonroad.planning.goal import GoalRegion
from commonroad.planning.planning_problem import PlanningProblem
from commonroad.prediction.prediction import TrajectoryPrediction
from commonroad.scenario.lanelet import Lanelet, LaneletNetwork
from commonroad.scenario.obstacle import DynamicObstacle, ObstacleType, StaticObstacle
from commonroad.scenario.scenario import Scenario
from commonroad.scenario.state import CustomState, InitialState, KSState
from commonroad.scenario.trajectory import Trajectory
from commonroad_dc import pycrcc

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.arrays.geometry import wrap_angle
from scenarionet_data.scenario.vocabulary import LightColor, ObjectType
from scenarionet_sim.planners.view import View
from scenarionet_sim.planners.way import Way
from scenarionet_sim.roads.roads import Roads

BEYOND = 150.0
"""Length of the reference path after the end of the route [m]."""

AXLE = 0.3
"""From the rear axle to the centre, as a share of the length: half of the trackers' wheelbase."""

_NEAR = 60.0  # [m] from the reference path within which lanes are handed over, and from the vehicle objects
_SEAM = 0.5  # [m] half of the width of gaps between lanes that are no edge of the road
_BESIDE = 0.3  # [m] beside the vehicle on its route that are road, whatever the map says
_THIN = 0.05  # [m] half of the width of the edge
_STANDS = 0.1  # [m/s] below which objects stand
_STOP = 0.25, 6.0  # [m] half of the length and width of what stands on a stop line while its light is not green
_KINDS = {
    ObjectType.VEHICLE: ObstacleType.CAR,
    ObjectType.PEDESTRIAN: ObstacleType.PEDESTRIAN,
    ObjectType.CYCLIST: ObstacleType.BICYCLE,
}


class CommonRoadScene:
    """The scene around a vehicle, for planners of CommonRoad.

    Args:
        view: The first moment of an episode, in the scenario's frame.
        horizon: Timesteps of forecasts.

    Attributes:
        scenario: Lanelets, and the obstacles of the moment of ``show``, forecast to go on with their velocity.
        problem: The vehicle at that moment, and the end of its route as the goal.
        reference: (P, 2) the route with a point at every metre, from 10 m behind the vehicle to 150 m after its end.
        edge: The edge of the road as a collision object; None without a map.
        checker: The edge and the obstacles as collision objects.
        length, width, axle: Of the vehicle, and from its rear axle to its centre [m].
    """

    def __init__(self, view: View, horizon: int) -> None:
        self.horizon, self.length, self.width = horizon, view.ego.length, view.ego.width
        self.axle = AXLE * view.ego.length
        left = float(view.route.arc[-1]) - view.route.position if len(view.route.arc) else 0.0
        self.reference: Float64 = Way.ahead(view, reach=max(left, 0.0) + BEYOND).points
        path = shapely.LineString(self.reference)
        near_path = path.buffer(_NEAR)
        roads = view.world.roads
        outlines = {
            row: shapely.make_valid(shapely.Polygon(roads.polygons[row]))
            for row in np.flatnonzero(roads.is_road & (roads.polygons.lengths > 2)).tolist()
        }
        near = {row: each for row, each in outlines.items() if each.intersects(near_path)}
        self.scenario = Scenario(view.dt)
        lanelets = list(_lanelets(roads, [row for row in near if row < roads.num_lanes]))
        self.scenario.add_objects(LaneletNetwork.create_from_lanelet_list(lanelets))
        self._free = 1 + roads.num_lanes
        road = shapely.union_all(list(near.values())).buffer(_SEAM).buffer(-_SEAM)
        road = road.union(path.buffer(0.5 * view.ego.width + _BESIDE))
        outline = road.boundary.simplify(_THIN).intersection(near_path)
        edge = pycrcc.ShapeGroup()
        for points in map(shapely.get_coordinates, shapely.get_parts(outline)):
            steps = np.diff(points, axis=0)
            for (x, y), step in zip((points[:-1] + 0.5 * steps).tolist(), steps, strict=True):
                length, angle = float(np.hypot(*step)), float(np.arctan2(step[1], step[0]))
                edge.add_shape(pycrcc.RectOBB(0.5 * length, _THIN, angle, x, y))
        self.edge = edge if near else None
        self.show(view)

    def show(self, view: View) -> None:
        """Move the obstacles and the vehicle to where they are now."""
        self.scenario.remove_obstacle(self.scenario.obstacles)
        checker = pycrcc.CollisionChecker()
        if self.edge is not None:
            checker.add_collision_object(self.edge)
        self.checker = Checker(checker)
        seen = view.objects
        is_near = np.hypot(*(seen.position - (view.ego.x, view.ego.y)).T) < _NEAR
        for number in np.flatnonzero(is_near).tolist():
            length, width = seen.size[number, :2].tolist()
            kind = _KINDS.get(ObjectType(seen.object_type[number]), ObstacleType.UNKNOWN)
            heading, velocity = float(wrap_angle(seen.heading[number])), seen.velocity[number]
            shape, speed = Rectangle(length, width), float(np.hypot(*velocity))
            box, places = (heading, 0.5 * length, 0.5 * width), seen.position[number][None].astype(np.float64)
            if speed < _STANDS:
                self.scenario.add_objects(_standing(self._free + number, kind, shape, places[0], heading))
            else:
                places = places + view.dt * np.arange(self.horizon + 1)[:, None] * velocity
                states = [
                    KSState(time_step=step, position=place, orientation=heading, velocity=speed, steering_angle=0.0)
                    for step, place in enumerate(places[1:], 1)
                ]
                start = InitialState(0, places[0], heading, speed, acceleration=0.0, yaw_rate=0.0)
                forecast = TrajectoryPrediction(Trajectory(1, states), shape)
                self.scenario.add_objects(DynamicObstacle(self._free + number, kind, shape, start, forecast))
            self.checker.add(places, *box)
        for number, (place, heading) in enumerate(_stops(view), self._free + len(seen)):
            shape = Rectangle(2.0 * _STOP[0], 2.0 * _STOP[1])
            self.scenario.add_objects(_standing(number, ObstacleType.ROAD_BOUNDARY, shape, place, heading))
            self.checker.add(place[None], heading, *_STOP)
        ego, left = view.ego, max(view.world.num_steps - 1 - view.timestep, 1)
        start = InitialState(
            time_step=0,
            position=np.array([ego.x, ego.y]),
            orientation=float(wrap_angle(ego.heading)),
            velocity=max(ego.speed, 0.0),
            acceleration=ego.acceleration,
            yaw_rate=ego.yaw_rate,
            slip_angle=0.0,
        )
        heading = float(view.route.heading[-1]) if len(view.route.arc) else ego.heading
        place = np.asarray(view.goal, np.float64) if len(view.route.arc) else start.position
        goal = Rectangle(ego.length, ego.width, place, float(wrap_angle(heading)))
        reached = GoalRegion([CustomState(time_step=Interval(left, left), position=goal)])
        self.problem = PlanningProblem(1, start, reached)

    def collides(self, poses: Float64) -> bool:
        """Return whether the vehicle at poses (T, 3) of its rear axle hits an obstacle or the edge of the road."""
        for step, (x, y, heading) in enumerate(poses.tolist()):
            place = x + self.axle * np.cos(heading), y + self.axle * np.sin(heading)
            box = pycrcc.RectOBB(0.5 * self.length, 0.5 * self.width, heading, *place)
            if self.checker.time_slice(step).collide(box):
                return True
        return False


class Checker:
    """A collision checker that cuts out each timestep once; planners cut it out for each pose that they check.

    Args:
        checker: Collision objects of all timesteps, without those that are added.
    """

    def __init__(self, checker: pycrcc.CollisionChecker) -> None:
        self._checker = checker
        self._slices: dict[int, pycrcc.CollisionChecker] = {}

    def add(self, places: Float64, heading: float, half_length: float, half_width: float) -> None:
        """Add a box (T, 2) [m] from now on, or (1, 2) one that stands."""
        boxes = [pycrcc.RectOBB(half_length, half_width, heading, x, y) for x, y in places.tolist()]
        moving = pycrcc.TimeVariantCollisionObject(0)
        for box in boxes:
            moving.append_obstacle(box)
        self._checker.add_collision_object(boxes[0] if len(boxes) == 1 else moving)

    def time_slice(self, step: int) -> pycrcc.CollisionChecker:
        """Return the checker of a timestep."""
        if step not in self._slices:
            self._slices[step] = self._checker.time_slice(step)
        return self._slices[step]


def _lanelets(roads: Roads, rows: list[int]) -> Iterator[Lanelet]:
    """Lanelets of lanes whose outline has points on both sides of the centreline."""
    sides = {row: sides_of(roads.lanes[row].astype(np.float64), roads.polygons[row].astype(np.float64)) for row in rows}
    held = {row for row, (left, right) in sides.items() if min(len(left), len(right)) > 1}
    after = {row: [int(each) for each in roads.successors[row] if each in held] for row in sorted(held)}
    before: dict[int, list[int]] = {row: [] for row in after}
    for row, others in after.items():
        for other in others:
            before[other].append(row + 1)
    for row, others in after.items():
        lines = sides[row][0], roads.lanes[row].astype(np.float64), sides[row][1]
        places = np.linspace(0.0, 1.0, max(map(len, lines)))
        left, centre, right = (
            shapely.get_coordinates(shapely.line_interpolate_point(shapely.LineString(each), places, normalized=True))
            for each in lines
        )
        yield Lanelet(left, centre, right, row + 1, before[row], [each + 1 for each in others])


def sides_of(centre: Float64, outline: Float64) -> tuple[Float64, Float64]:
    """Return the points of an outline (P, 2) [m] to the left and to the right of a centreline, in its direction."""
    line = shapely.LineString(centre)
    arc = shapely.line_locate_point(line, shapely.points(outline))
    back, foot, ahead = (
        shapely.get_coordinates(shapely.line_interpolate_point(line, np.clip(arc + by, 0.0, line.length)))
        for by in (-0.1, 0.0, 0.1)
    )
    along, off = ahead - back, outline - foot
    beside = along[:, 0] * off[:, 1] - along[:, 1] * off[:, 0]
    order = np.argsort(arc, kind="stable")
    return outline[order[beside[order] > 0.0]], outline[order[beside[order] < 0.0]]


def _standing(number: int, kind: ObstacleType, shape: Rectangle, place: Float64, heading: float) -> StaticObstacle:
    start = InitialState(time_step=0, position=place, orientation=heading, velocity=0.0)
    return StaticObstacle(number, kind, shape, start)


def _stops(view: View) -> Iterator[tuple[Float64, float]]:
    """Place [m] and heading [rad] on the route of what stands on stop lines of red and yellow lights ahead."""
    route = view.route
    is_closed = view.lights.color[route.stop_light] >= LightColor.YELLOW
    for arc in route.stop_arc[is_closed & (route.stop_arc > route.position + 0.5 * view.ego.length - 0.5)].tolist():
        arc += _STOP[0]  # its near side is on the line
        x, y, heading = (
            float(np.interp(arc, route.arc, each)) for each in (*route.centreline.T, np.unwrap(route.heading))
        )
        yield np.array([x, y]), float(wrap_angle(heading))
