"""Relations of two objects by compiled functions, in the place of their SQL, which stays what defines them.

Where a query has the whole SQL of a relation, it can read the spans from a table instead. Relations that were narrowed
to few objects (see :mod:`.narrowing`) are left to SQL.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cached_property
from math import hypot, inf, pi
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from scenarionet_data.arrays.dtypes import Int64, UInt64
from scenarionet_data.operations.moments import NAMED, relation, runs_of
from scenarionet_data.query import pair_kernels as kernels
from scenarionet_data.query.lake_view import LakeView
from scenarionet_data.query.pair_kernels import LinkedLanes, PairStates, find_spans

_DIRECTIONS = {"forward": (1, 0), "left": (0, 1), "backward": (-1, 0), "right": (0, -1)}
_ANGLES = {"same": (0, 45), "opposite": (135, inf), "perpendicular": (45, 135)}
_SIDES = {"same": kernels.SAME_SIDE, "opposite": kernels.OPPOSITE_SIDE}
_ROUNDS = {"either": 0, "counterclockwise": 1, "clockwise": -1}
_NO_LINKS = LinkedLanes(*(np.zeros(count, np.int64) for count in (1, 0, 0)))
_LANE = "hash(dataset, version, map_id, {})"
"""SQL of a number of a lane; two lanes of a million have the same one with a probability of 1e-8."""
_WALKED = """
SELECT track, found.lane AS lane, len(lanes)::BIGINT AS near, len(found.lane)::BIGINT AS num_steps
FROM walked_lanes JOIN owners USING (scenario_id, track_id) ORDER BY track
"""
_NEAR = f"""
SELECT {_LANE.format("near.lane_id")} AS lane
FROM (
    SELECT track, dataset, version, map_id, unnest(lanes) AS near, unnest(range(len(lanes))) AS i
    FROM walked_lanes JOIN owners USING (scenario_id, track_id)
)
ORDER BY track, i
"""
_LINKS = f"""
WITH links AS (
    SELECT dataset, version, map_id, lane_id, other_lane_id, {kernels.CONTINUES} AS kind FROM lane_continuations
    UNION ALL SELECT * REPLACE (if(is_opposite, {kernels.OPPOSITE_SIDE}, {kernels.SAME_SIDE}) AS is_opposite)
    FROM (SELECT dataset, version, map_id, lane_id, other_lane_id, is_opposite FROM road_sides)
    UNION ALL SELECT dataset, version, map_id, lane_id, unnest(exit_lanes), {kernels.EXIT} FROM lane_outlines
    UNION ALL SELECT
        dataset, version, map_id, lane_id, unnest(list_concat(left_neighbors, right_neighbors)), {kernels.NEIGHBOUR}
    FROM lane_outlines
)
SELECT {_LANE.format("lane_id")} AS lane, {_LANE.format("other_lane_id")} AS other, kind FROM links
"""


class CompiledRelations:
    """Relations of two objects over the scenarios of a view, whose states are read once.

    Args:
        view: The view, see :attr:`LakeView.keeping <scenarionet_data.query.lake_view.LakeView.keeping>`.
    """

    def __init__(self, view: LakeView) -> None:
        self._view = view
        self._found: dict[str, pa.Table] = {}

    def arrow(
        self, sql: str, given: Mapping[str, Any] | None = None, *, tables: Mapping[str, pa.Table] | None = None
    ) -> pa.Table:
        """Run a SELECT, with its relations from tables where that is possible.

        Args:
            sql: The SELECT.
            given: Values for ``$name`` in it.
            tables: Tables that it uses, by name.
        """
        read = dict(tables or {})
        for name, parameters in set(NAMED.findall(sql)):
            values = json.loads(parameters)
            steps, arguments = relation(name, values), _arguments(name, values)
            if arguments is None or steps.sql not in sql:
                continue
            if steps.sql not in self._found:
                self._found[steps.sql] = self._spans(*arguments)
            table = f"compiled_{list(self._found).index(steps.sql)}"
            read[table] = self._found[steps.sql]
            unnested = "unnest(range(first_timestep, last_timestep + 1))::INTEGER AS timestep"
            sql = sql.replace(runs_of(steps.sql, steps.roles), f"SELECT * FROM {table}")
            sql = sql.replace(steps.sql, f"SELECT scenario_id, track_id, other_id, {unnested} FROM {table}")
        return self._view.arrow(sql, given, tables=read)

    def _spans(self, relation: int, given: tuple[float, ...], reach: float) -> pa.Table:
        states, links = self._states, _NO_LINKS
        if relation in (kernels.ON_LANES, kernels.FOLLOWING):
            states, links = states._replace(lane=self._lanes), self._links
        found = find_spans(relation, np.array([*given, *[0.0] * 5][:5]), reach, states, links)
        tracks, others = (self._owners.take(pa.array(found[:, role])) for role in (0, 1))
        columns = [tracks["scenario_id"], tracks["track_id"], others["track_id"]]
        columns += [pa.array(found[:, edge], pa.int32()) for edge in (2, 3)]
        return pa.table(columns, ["scenario_id", "track_id", "other_id", "first_timestep", "last_timestep"])

    @cached_property
    def _motions(self) -> pa.Table:
        """The view ``motions`` of objects that were observed, in any order."""
        columns = ", ".join(name for name in PairStates._fields[3:] if name not in ("lane", "walks"))
        sql = f"SELECT scenario_id, track_id, object_type, {columns} FROM motions WHERE len(timestep) > 0"
        return self._view.arrow(sql).combine_chunks()

    @cached_property
    def _order(self) -> Int64:
        """Rows of _motions by scenario and track."""
        keys = [("scenario_id", "ascending"), ("track_id", "ascending")]
        order: Int64 = pc.sort_indices(self._motions, sort_keys=keys).to_numpy().astype(np.int64)
        return order

    @cached_property
    def _owners(self) -> pa.Table:
        return self._motions.select(["scenario_id", "track_id"]).take(self._order)

    @cached_property
    def _states(self) -> PairStates:
        columns = {name: _elements(self._motions[name]) for name in PairStates._fields[5:] if name != "walks"}
        lengths = pc.list_value_length(self._motions["timestep"]).to_numpy()
        starts = np.cumsum(lengths) - lengths
        reach = [
            edge.reduceat(outermost(columns[axis], columns[f"box_{axis}"]) + sign * columns["radius"], starts)[
                self._order
            ]
            for axis in ("x", "y")
            for edge, outermost, sign in ((np.fmin, np.minimum, -1), (np.fmax, np.maximum, 1))
        ]
        walks = pc.is_in(self._motions["object_type"], pa.array(["VEHICLE", "PEDESTRIAN", "CYCLIST"]))
        _, tracks = np.unique(self._owners["scenario_id"].to_numpy(), return_counts=True)
        return PairStates(
            _ends(tracks),
            np.stack([starts, starts + lengths], axis=1)[self._order],
            np.stack(reach, axis=1),
            _elements(self._motions["timestep"]).astype(np.int64),
            np.zeros(0, np.int64),  # no lanes
            **columns,
            walks=np.repeat(walks.to_numpy(), lengths),
        )

    @cached_property
    def _lanes(self) -> Int64:
        """The number of the lane of each state; -1 for none."""
        owners = {"owners": self._owners.append_column("track", pa.array(np.arange(len(self._owners))))}
        walked = self._view.arrow(_WALKED, tables=owners)
        near, count = (walked[name].to_numpy() for name in ("near", "num_steps"))
        lane = pc.fill_null(pc.list_flatten(walked["lane"]), 0).to_numpy().astype(np.int64)
        near_lanes = self._view.arrow(_NEAR, tables=owners)["lane"].to_numpy()
        numbers = np.searchsorted(self._lane_keys, near_lanes)
        on_lane = lane > 0
        lane += np.repeat(np.cumsum(near) - near, count) - 1
        first = self._states.tracks[walked["track"].to_numpy(), 0]
        lanes = np.full(len(self._states.timestep), -1)
        lanes[(np.repeat(first - np.cumsum(count) + count, count) + np.arange(len(lane)))[on_lane]] = numbers[
            lane[on_lane]
        ]
        return lanes

    @cached_property
    def _lane_keys(self) -> UInt64:
        """The keys of all lanes, ascending; a lane's number is its place."""
        return np.unique(self._view.arrow(f"SELECT {_LANE.format('lane_id')} FROM lane_outlines")[0].to_numpy())

    @cached_property
    def _links(self) -> LinkedLanes:
        lane, other, kind = (column.to_numpy() for column in self._view.arrow(_LINKS).columns)
        lanes, others = (np.searchsorted(self._lane_keys, keys) for keys in (lane, other))
        count = len(self._lane_keys)
        is_known = self._lane_keys[np.minimum(others, count - 1)] == other  # maps name lanes that they lack
        pairs, inverse = np.unique(lanes[is_known] * count + others[is_known], return_inverse=True)
        kinds = np.zeros(len(pairs), np.int64)
        np.bitwise_or.at(kinds, inverse, kind[is_known])
        return LinkedLanes(_ends(np.bincount(pairs // count, minlength=count)), pairs % count, kinds)


def _elements(lists: pa.ChunkedArray) -> Any:
    """The elements of lists, one after the other; NaN of null."""
    return pc.list_flatten(lists).combine_chunks().to_numpy(zero_copy_only=False)


def _ends(counts: Int64) -> Int64:
    """Where each of some parts of such lengths begins, and where the last ends."""
    return np.append(0, np.cumsum(counts)).astype(np.int64)


def _arguments(name: str, values: Mapping[str, Any]) -> tuple[int, tuple[float, ...], float] | None:
    """Return the arguments of find_spans for a relation and its parameters; None for what only SQL computes."""
    match name, values:
        case "near_objects", {"distance_thresh": limit, "min_objects": 1}:
            return kernels.NEAR, (limit,), limit
        case "has_objects_in_relative_direction", {"min_number": 1, "max_number": most} if most >= 1_000_000:
            limit, way = values["within_distance"], _DIRECTIONS.get(values["direction"])
            return way and (kernels.BESIDE, (limit, values["lateral_thresh"], *way), limit)
        case "facing_toward", _:
            return kernels.FACING, (values["max_distance"], values["within_angle"] * (pi / 180)), values["max_distance"]
        case "heading_toward", _:
            limits = values["max_distance"], values["angle_threshold"], values["minimum_speed"]
            return kernels.TOWARD, limits, limits[0]
        case "heading_in_relative_direction_to", {"direction": direction} if direction in _ANGLES:
            return kernels.COURSES, _ANGLES[direction], inf
        case "being_crossed_by", {"direction": direction, "in_direction": side}:
            way, ahead, beyond = _DIRECTIONS.get(direction), values["forward_thresh"], values["lateral_thresh"]
            if way and side in _ROUNDS:
                return kernels.CROSSED, (ahead, beyond, *way, _ROUNDS[side]), hypot(ahead, 10.0)
        case "in_same_lane", _:
            return kernels.ON_LANES, (kernels.CONTINUES,), inf
        case "on_relative_side_of_road", {"side": side} if side in _SIDES:
            return kernels.ON_LANES, (_SIDES[side],), inf
        case "following", _:
            return kernels.FOLLOWING, (), hypot(25.0, 15.0)
    return None
