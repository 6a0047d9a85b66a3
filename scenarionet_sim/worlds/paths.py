"""Where objects drove, without when, and where on that way traffic lights stop them.

N objects, P points of all paths, L lights.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Float32, Int32
from scenarionet_sim.kernels.log import HEADING, Z, thin
from scenarionet_sim.kernels.paths import find_stops
from scenarionet_sim.roads.roads import Roads

SPACING = 0.1
"""Points of a path are at least this far apart [m]: a standing object's noise makes no path."""


@dataclass(frozen=True, eq=False)
class Paths:
    """Where each object drove, without when: the reference path of each, the ego's is its route.

    Object n has the points ``offsets[n]:offsets[n + 1]``; none when it is never valid, one when it stands.

    Attributes:
        path_points: (P, 2) float32 [m], at least ``SPACING`` apart.
        path_arc: (P,) float32 [m] distance from the path's first point.
        path_heading: (P,) float32 [rad] as recorded: an object may drive backwards.
        path_z: (P,) float32 [m] of the box's centre.
        path_offsets: (N + 1,) int32.
    """

    path_points: Float32
    path_arc: Float32
    path_heading: Float32
    path_z: Float32
    path_offsets: Int32

    def length(self) -> Float32:
        """(N,) float32 [m] length of each path, 0 without points."""
        first, end = self.path_offsets[:-1], self.path_offsets[1:]
        length = np.zeros(len(first), np.float32)
        length[end > first] = self.path_arc[end[end > first] - 1]
        return length

    @classmethod
    def from_log(cls, log: Float32) -> Paths:
        """The paths of a log (T, N, 8)."""
        is_kept = np.empty((log.shape[1], log.shape[0]), np.bool_)
        thin(log, SPACING, is_kept)
        track, step = np.nonzero(is_kept)
        states = log[step, track]
        offsets = np.concatenate([[0], np.cumsum(is_kept.sum(axis=1))]).astype(np.int32)
        hops = np.append(0.0, np.hypot(*np.diff(states[:, :2].astype(np.float64), axis=0).T))
        total = np.cumsum(hops)
        arc = total - np.repeat(total[np.minimum(offsets[:-1], max(len(total) - 1, 0))], np.diff(offsets))
        return cls(
            path_points=np.ascontiguousarray(states[:, :2]),
            path_arc=arc.astype(np.float32),
            path_heading=np.ascontiguousarray(states[:, HEADING]),
            path_z=np.ascontiguousarray(states[:, Z]),
            path_offsets=offsets,
        )


@dataclass(frozen=True, eq=False)
class Stops:
    """Where paths meet the stop points of the lights that govern them.

    Object n has the stops ``offsets[n]:offsets[n + 1]``, in order along its path.

    Attributes:
        stop_arc: (K,) float32 [m] along the path.
        stop_light: (K,) int32 row of the light.
        stop_offsets: (N + 1,) int32.
    """

    stop_arc: Float32
    stop_light: Int32
    stop_offsets: Int32

    @classmethod
    def on(cls, paths: Paths, lane: Int32, stop: Float32, roads: Roads) -> Stops:
        """The stops on paths.

        Args:
            paths: Of N objects.
            lane: (L,) row of each light's lane, or -1.
            stop: (L, 2) [m] its stop point, NaN when unknown.
            roads: The map.
        """
        found = np.full((len(paths.path_offsets) - 1, len(lane)), np.nan, np.float32)
        arrays = paths.path_points, paths.path_arc, paths.path_heading, paths.path_z, paths.path_offsets
        if len(lane):  # without lights there is nothing to compile it for
            find_stops(*arrays, lane, stop, roads.lanes.values, roads.lanes.offsets, found)
        order = np.argsort(found, axis=1, kind="stable")
        arcs = np.take_along_axis(found, order, axis=1)
        is_stop = ~np.isnan(arcs)
        offsets = np.concatenate([[0], np.cumsum(is_stop.sum(axis=1))]).astype(np.int32)
        return cls(arcs[is_stop], order[is_stop].astype(np.int32), offsets)
