"""The frame in which criticality is measured: along the lanes that an object drives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import shapely

from scenarionet_data.arrays.dtypes import Array, Bool, Float64, Int64
from scenarionet_data.interchange.base import Losses
from scenarionet_data.interchange.lanelets import Lanelet, make_lanelets
from scenarionet_data.scenario.description import MapFeatures

_REACH = 2  # lanes before the first and after the last that is driven
_STEP = 2.0  # [m] between points of a path
_BESIDE = 3  # lanes to a side that count as driven
_FAR = 20.0  # [m] places farther from a path are not on it
_ALIGNED = 0.5  # cosine between the heading of an object and the lane that it drives


@dataclass(frozen=True)
class DrivenPath:
    """A path with a place along it and beside it for every point near it.

    The tangent turns steadily between the points of the path, so that places are continuous in bends: Hery et al.,
    Map-based curvilinear coordinates for autonomous vehicles, 2017, equation 7.

    Attributes:
        points: (P, 2) [m], no two successive ones equal.
    """

    points: Float64

    @cached_property
    def _tangents(self) -> Float64:
        ahead = np.concatenate([self.points[1:2] - self.points[:1], self.points[2:] - self.points[:-2],
                                self.points[-1:] - self.points[-2:-1]])  # fmt: skip
        unit: Float64 = ahead / np.linalg.norm(ahead, axis=1, keepdims=True)
        return unit

    def places(self, x: Float64, y: Float64) -> tuple[Float64, Float64, Float64]:
        """Return where points (...) are: along the path and to its left [m], and its direction there [rad].

        NaN for points beyond its ends, or farther than 20 m from it.
        """
        step = np.diff(self.points, axis=0)
        length = np.linalg.norm(step, axis=1)
        ahead = step / length[:, None]
        cos = self._tangents[:-1], self._tangents[1:]
        slopes = [(ahead[:, 0] * t[:, 1] - ahead[:, 1] * t[:, 0]) / (ahead * t).sum(axis=1) for t in cos]
        dx, dy = x[..., None] - self.points[:-1, 0], y[..., None] - self.points[:-1, 1]
        along, aside = dx * ahead[:, 0] + dy * ahead[:, 1], dy * ahead[:, 0] - dx * ahead[:, 1]
        with np.errstate(divide="ignore", invalid="ignore"):
            spread = length - aside * (slopes[1] - slopes[0])  # not positive beyond the centre of a bend
            share = (along + aside * slopes[0]) / spread
            apart = np.hypot(along - share * length, aside)
        apart[~((spread > 0) & (share >= -1e-7) & (share <= 1 + 1e-7) & (apart < _FAR))] = np.inf
        best = apart.argmin(axis=-1)[..., None]

        def chosen(values: Float64) -> Float64:
            return np.take_along_axis(values, best, axis=-1)[..., 0]

        share, apart, aside, best = chosen(share), chosen(apart), chosen(aside), best[..., 0]
        is_on = np.isfinite(apart)
        starts = np.concatenate([[0.0], np.cumsum(length)])[best]
        tangent = (1 - share[..., None]) * self._tangents[best] + share[..., None] * self._tangents[best + 1]
        return (
            np.where(is_on, starts + share * length[best], np.nan),
            np.where(is_on, np.copysign(apart, aside), np.nan),
            np.where(is_on, np.arctan2(tangent[..., 1], tangent[..., 0]), np.nan),
        )


def smooth_path(points: Float64) -> Float64:
    """Return a polyline (P, 2) with its corners cut once (Chaikin 1974), through points 2 m apart at most."""
    cut = np.repeat(points, 2, axis=0)
    other = cut.copy()
    other[1:-1:2], other[2::2] = cut[2::2], cut[1:-1:2]
    cut = 0.75 * cut + 0.25 * other
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(cut, axis=0), axis=1))])
    wanted = np.linspace(0.0, along[-1], max(int(np.ceil(along[-1] / _STEP + 1)), 3))
    return np.column_stack([np.interp(wanted, along, cut[:, axis]) for axis in (0, 1)])


class Held(NamedTuple):
    """Objects on lanes, in order of object and time, the nearest lane first.

    Attributes:
        at: Index of object and timestep in the flat array of both.
        lane: The lane.
        offset: How far the object is to the left of its middle [m].
    """

    at: Int64
    lane: Int64
    offset: Float64


class LaneAreas:
    """The lanes of a map, and which of them objects are on.

    Attributes:
        lanelets: The lanes.
    """

    def __init__(self, features: MapFeatures | None) -> None:
        self.lanelets: list[Lanelet] = [] if features is None else make_lanelets(features, Losses())
        self._index = {lanelet.row: index for index, lanelet in enumerate(self.lanelets)}
        self._outlines = [
            shapely.make_valid(shapely.polygons(np.concatenate([lane.left[:, :2], lane.right[::-1, :2]])))
            for lane in self.lanelets
        ]
        self._tree = shapely.STRtree(self._outlines)
        self._links = [
            np.array([index, *(self._index[row] for row in (*lane.before, *lane.after) if row in self._index)])
            for index, lane in enumerate(self.lanelets)
        ]

        self._beside = [
            (index, self._index[beside.row])
            for index, lane in enumerate(self.lanelets)
            for beside in (lane.on_left, lane.on_right)
            if beside is not None and not beside.is_opposite
        ]

    def outline(self, index: int) -> shapely.Geometry:
        """Return the area of a lane."""
        return self._outlines[index]

    def at(self, points: Array) -> Array:
        """Return the areas of lanes that any of some points are on."""
        found: Array = self._tree.geometries[np.unique(self._tree.query(points, predicate="intersects")[1])]
        return found

    def centre(self, index: int) -> Float64:
        """Return the middle (P, 2) between the sides of a lane [m]."""
        return 0.5 * (self.lanelets[index].left[:, :2] + self.lanelets[index].right[:, :2])

    def neighbourhood(self, outlines: Array) -> Bool:
        """Return which lanes polygons (...) touch, with those before and after: (..., lanes); none for no polygon."""
        touched = np.zeros((outlines.size, len(self.lanelets)), np.bool_)
        at, lanes = self._tree.query(outlines.ravel(), predicate="intersects")
        counts = np.array([len(links) for links in self._links], dtype=np.int64)[lanes]
        linked = np.concatenate([self._links[lane] for lane in lanes]) if len(lanes) else lanes
        touched[np.repeat(at, counts), linked] = True
        return touched.reshape(*outlines.shape, len(self.lanelets))

    def held(self, x: Float64, y: Float64, heading: Float64) -> Held:
        """Return the lanes that hold objects (N, T) and lead their way, within 60 degrees."""
        seen = np.flatnonzero(np.isfinite(x).ravel())
        x, y, heading = (each.ravel()[seen] for each in (x, y, heading))
        at, lanes = self._tree.query(shapely.points(x, y), predicate="intersects")
        offsets = np.full(len(at), np.nan)
        for lane in np.unique(lanes).tolist():
            mine = lanes == lane
            points = at[mine]
            _, aside, way = DrivenPath(self.centre(lane)).places(x[points], y[points])
            offsets[mine] = np.where(np.cos(heading[points] - way) > _ALIGNED, aside, np.nan)
        kept = np.flatnonzero(np.isfinite(offsets))
        kept = kept[np.lexsort((np.abs(offsets[kept]), at[kept]))]
        return Held(seen[at[kept]], lanes[kept], offsets[kept])

    def chain(self, driven: Int64) -> list[int]:
        """Return the lanes from two before the first that is driven to two after the last.

        It goes on beside the lanes to which the object changes. At a fork it takes the lane that is driven longest, or
        the one nearest to it, or the first.

        Args:
            driven: Lanes that hold the object, in order of time, the nearest first.
        """
        if not len(driven):
            return []
        time = np.bincount(driven, minlength=len(self.lanelets)).astype(np.float64)
        for _ in range(_BESIDE):
            for lane, beside in self._beside:
                time[lane] = max(time[lane], 0.1 * time[beside])
        chain, beyond = [int(driven[0])], 0
        while beyond < _REACH:
            after = [self._index[row] for row in self.lanelets[chain[-1]].after]
            after = [lane for lane in after if lane not in chain]
            if not after:
                break
            chain.append(max(after, key=lambda lane: time[lane]))
            beyond = 0 if time[chain[-1]] else beyond + 1
        for _ in range(_REACH):
            before = [self._index[row] for row in self.lanelets[chain[0]].before]
            if not before or before[0] in chain:
                break
            chain.insert(0, before[0])
        return chain

    def path(self, chain: Sequence[int]) -> DrivenPath:
        """Return the path along successive lanes."""
        return DrivenPath(smooth_path(np.concatenate([self.centre(lane) for lane in chain])))
