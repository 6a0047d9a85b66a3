"""Reference paths of objects, and the stop points of traffic lights on them.

N objects, P points of all paths, L lights.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from scenarionet_data.arrays.dtypes import Float32, Float64, Int32, IntP
from scenarionet_sim.arrays.log import ARC, thin, trace
from scenarionet_sim.roads.roads import Roads
from scenarionet_sim.worlds.path_kernels import find_stops

SPACING = 0.1
"""Least distance between points of a path [m]: the noise of a standing object must not form a path."""


@dataclass(frozen=True, eq=False)
class Paths:
    """The reference path of each object: its driven positions without times. The ego's path is its route.

    Object n has the points ``path_offsets[n]:path_offsets[n + 1]``: none if it is never valid, one if it never moves.

    Attributes:
        path: (P, 5) float32 x, y, z [m] of the box's centre, heading [rad] as recorded (an object may drive
            backwards), distance from the path's first point [m]. Points are at least ``SPACING`` apart, and no path
            turns back: see :func:`without_cusps`.
        path_offsets: (N + 1,) int32.
    """

    path: Float32
    path_offsets: Int32

    @property
    def path_points(self) -> Float32:
        """(P, 2) view [m]."""
        return self.path[:, :2]

    @property
    def path_arc(self) -> Float32:
        """(P,) arc length of each path point [m] (a view)."""
        return self.path[:, ARC]

    def length(self) -> Float32:
        """Return the length (N,) float32 of each path [m]; 0 without points."""
        return self._length

    @cached_property
    def _length(self) -> Float32:
        first, end = self.path_offsets[:-1], self.path_offsets[1:]
        length = np.zeros(len(first), np.float32)
        length[end > first] = self.path_arc[end[end > first] - 1]
        return length

    @classmethod
    def from_log(cls, log: Float32) -> Paths:
        """Return the paths of a log (T, N, 8)."""
        is_kept = np.empty((log.shape[1], log.shape[0]), np.bool_)
        thin(log, SPACING, is_kept)
        path = np.empty((int(is_kept.sum()), 5), np.float32)
        offsets, turns_back = np.empty(len(is_kept) + 1, np.int32), np.empty(len(is_kept), np.bool_)
        trace(log, is_kept, path, offsets, turns_back)
        if turns_back.any():
            for n in np.flatnonzero(turns_back).tolist():
                steps = np.flatnonzero(is_kept[n])
                is_kept[n] = False
                is_kept[n, steps[without_cusps(log[steps, n, :2].astype(np.float64))]] = True
            path = path[: int(is_kept.sum())].copy()
            trace(log, is_kept, path, offsets, turns_back)
        return cls(path, offsets)


def without_cusps(points: Float64) -> IntP:
    """Return which points (P, 2) to keep, so that a path nowhere turns by more than a right angle.

    An object that steps back once would have a path that leads back at full speed. The shortest way between two cusps
    is dropped, until none is left; after one in the middle, the path goes on ahead of where that began.
    """
    kept = np.arange(len(points))
    while True:
        hops = np.diff(points[kept], axis=0)
        cusps = np.flatnonzero((hops[1:] * hops[:-1]).sum(axis=1) < 0.0) + 1
        if not len(cusps):
            return kept
        ends = np.array([0, *cusps, len(kept) - 1])
        shortest = int(np.argmin(np.diff(np.append(0.0, np.cumsum(np.hypot(*hops.T)))[ends])))
        first, last = ends[shortest : shortest + 2].tolist()
        if shortest == 0:
            kept = kept[last:]
            continue
        ahead = (points[kept[last:]] - points[kept[first]]) @ hops[first - 1] > 0.0
        goes_on = last + int(np.argmax(ahead)) if ahead.any() and last < len(kept) - 1 else len(kept)
        kept = np.concatenate([kept[: first + 1], kept[goes_on:]])


@dataclass(frozen=True, eq=False)
class Stops:
    """Stop points of the lights that govern each path.

    Object n has the stops ``stop_offsets[n]:stop_offsets[n + 1]``, in order along its path.

    Attributes:
        stop_arc: (K,) float32 arc length on the path [m].
        stop_light: (K,) int32 row of the light.
        stop_offsets: (N + 1,) int32.
    """

    stop_arc: Float32
    stop_light: Int32
    stop_offsets: Int32

    @classmethod
    def on(cls, paths: Paths, lane: Int32, stop: Float32, roads: Roads) -> Stops:
        """Find the stops on paths.

        Args:
            paths: Paths of N objects.
            lane: (L,) row of each light's lane, or -1.
            stop: (L, 2) stop point of each light [m], NaN if unknown.
            roads: The map.
        """
        count = len(paths.path_offsets) - 1
        if not len(lane):
            return cls(np.zeros(0, np.float32), np.zeros(0, np.int32), np.zeros(count + 1, np.int32))
        found, lane_path = (
            np.full((count, len(lane)), np.nan, np.float32),
            np.zeros((len(roads.lanes.values), 5), np.float32),
        )
        lane_path[:, :2] = roads.lanes.values
        find_stops(paths.path, paths.path_offsets, lane, stop, lane_path, roads.lanes.offsets, found)
        order = np.argsort(found, axis=1, kind="stable")
        arcs = np.take_along_axis(found, order, axis=1)
        is_stop = ~np.isnan(arcs)
        offsets = np.concatenate([[0], np.cumsum(is_stop.sum(axis=1))]).astype(np.int32)
        return cls(arcs[is_stop], order[is_stop].astype(np.int32), offsets)
