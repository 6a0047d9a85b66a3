"""The route ahead of a vehicle as a line to drive along, and what stands on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.arrays.geometry import wrap_angle
from scenarionet_data.scenario.vocabulary import LightColor
from scenarionet_sim.planners.view import View

_BEYOND = 200.0  # [m] that a route goes straight on after its end
_AXLE = 0.3  # from the rear axle to the centre, as a share of the length: half of the trackers' wheelbase


@dataclass(frozen=True, eq=False)
class Way:
    """The route from a vehicle on, with a point at every metre; Q points, in the view's frame.

    Attributes:
        points: (Q, 2) [m].
        heading: (Q,) along the route [rad], continuous.
        arc: (Q,) distance from the vehicle [m], 0 at the vehicle.
        lateral: Offset of the vehicle to the left of the route [m].
        end: Distance ahead at which the lanes end [m]; infinite without a map.
        axle: From the rear axle of the vehicle to its centre [m].
    """

    points: Float64
    heading: Float64
    arc: Float64
    lateral: float
    end: float
    axle: float

    @classmethod
    def ahead(cls, view: View, reach: float = 120.0, behind: float = 10.0) -> Way:
        """Return the part of the route that a planner looks at; after its end it goes on along the lanes.

        Where these end, too, and without a map, it goes straight on; before its start it comes straight.
        """
        route = view.route
        points = np.concatenate([route.centreline.astype(np.float64), route.beyond])
        if not len(points):
            points = np.array([[view.ego.x, view.ego.y]])
        heading = float(route.heading[-1]) if len(route.arc) else view.ego.heading
        if len(route.beyond) > 1:
            heading = float(np.arctan2(*(points[-1] - points[-2])[::-1]))
        straight = points[-1] + _BEYOND * np.array([np.cos(heading), np.sin(heading)])
        arcs = np.append(0.0, np.cumsum(np.hypot(*np.diff(points, axis=0).T)))
        end = float(arcs[-1]) - route.position if len(view.lanes) and len(route.arc) > 1 else np.inf
        first = float(route.heading[0]) if len(route.arc) else view.ego.heading
        before = points[0] - behind * np.array([np.cos(first), np.sin(first)])
        points, arcs = np.vstack([before, points, straight]), np.hstack([-behind, arcs, arcs[-1] + _BEYOND])
        arc = np.arange(-behind, reach, 1.0)
        there = np.column_stack([np.interp(arc + route.position, arcs, points[:, axis]) for axis in range(2)])
        step = np.diff(there, axis=0)
        along = np.unwrap(np.arctan2(step[:, 1], step[:, 0]))
        return cls(there, np.append(along, along[-1]), arc, route.lateral, end, _AXLE * view.ego.length)

    def pose(self, arc: Float64 | float, lateral: Float64 | float = 0.0) -> Float64:
        """Return poses (..., 3) of the vehicle's centre at distances and offsets to the left [m].

        The rear axle is on the way and moves along the heading, as that of a vehicle does. Centres on the way with its
        heading there are no motion of a vehicle, and lead trackers a metre inside of bends.
        """
        poses = self.at(arc - self.axle, lateral)
        poses[..., 0] += self.axle * np.cos(poses[..., 2])
        poses[..., 1] += self.axle * np.sin(poses[..., 2])
        return poses

    def at(self, arc: Float64 | float, lateral: Float64 | float = 0.0) -> Float64:
        """Return poses (..., 3) of the way itself at distances and offsets to the left [m]."""
        x, y, heading = (np.interp(arc, self.arc, each) for each in (*self.points.T, self.heading))
        x, y = x - np.sin(heading) * lateral, y + np.cos(heading) * lateral
        return np.stack([x, y, wrap_angle(heading)], axis=-1)

    def along(self, arcs: Float64, laterals: Float64) -> Float64:
        """Return the poses (..., T, 3) of a drive from the vehicle on, with headings in the direction of motion.

        Args:
            arcs: (..., T) distances ahead, rising [m].
            laterals: (..., T) offsets to the left [m].
        """
        poses = self.pose(arcs, laterals)
        over = np.diff(laterals, axis=-1, prepend=self.lateral)
        ahead = np.diff(arcs, axis=-1, prepend=0.0)
        poses[..., 2] = wrap_angle(poses[..., 2] + np.arctan2(over, np.maximum(ahead, 0.1)))
        return poses

    def locate(self, points: Float64) -> tuple[Float64, Float64]:
        """Return the distances (N,) along the way of points (N, 2), and their offsets to its left [m]."""
        apart = points[:, None] - self.points
        nearest = np.argmin((apart * apart).sum(axis=2), axis=1)
        heading, over = self.heading[nearest], apart[np.arange(len(points)), nearest]
        along = np.cos(heading) * over[:, 0] + np.sin(heading) * over[:, 1]
        return self.arc[nearest] + along, np.cos(heading) * over[:, 1] - np.sin(heading) * over[:, 0]

    def speed_for_bends(self, lateral_acceleration: float, deceleration: float) -> float:
        """Return the highest speed that can be reduced in time for every bend ahead [m/s]."""
        ahead = self.arc[:-1] >= 0.0
        curvature = np.abs(np.diff(self.heading))[ahead]
        allowed = lateral_acceleration / np.maximum(curvature, 1e-4) + 2.0 * deceleration * self.arc[:-1][ahead]
        return float(np.sqrt(allowed.min()))


@dataclass(frozen=True, eq=False)
class Obstacles:
    """Objects in the coordinates of a way, N of them.

    Attributes:
        arc, lateral: (N,) distance ahead and offset to the left of the way [m].
        speed: (N,) along the way [m/s].
        half_length, half_width: (N,) extents along and across the way [m].
    """

    arc: Float64
    lateral: Float64
    speed: Float64
    half_length: Float64
    half_width: Float64

    @classmethod
    def on(cls, way: Way, view: View) -> Obstacles:
        """Return the objects of a view; the end of the road and stop lines of red and yellow lights are such, too."""
        seen = view.objects
        arc, lateral = way.locate(seen.position)
        heading = np.interp(arc, way.arc, way.heading)
        speed = np.cos(heading) * seen.velocity[:, 0] + np.sin(heading) * seen.velocity[:, 1]
        cos, sin = np.abs(np.cos(seen.heading - heading)), np.abs(np.sin(seen.heading - heading))
        length, width = 0.5 * seen.size[:, 0], 0.5 * seen.size[:, 1]
        color = view.lights.color[view.route.stop_light]
        stops = view.route.stop_arc[color >= LightColor.YELLOW] - view.route.position
        stops = stops[stops > 0.5 * view.ego.length - 0.5]
        if way.end < way.arc[-1]:
            stops = np.append(stops, max(way.end, 0.0) + 0.5 * view.ego.length)
        none = np.zeros(len(stops))
        return cls(
            np.append(arc, stops),
            np.append(lateral, none),
            np.append(speed, none),
            np.append(cos * length + sin * width, none),
            np.append(sin * length + cos * width, none),
        )
