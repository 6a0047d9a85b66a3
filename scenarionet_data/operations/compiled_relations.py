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

from scenarionet_data.arrays.dtypes import Int64
from scenarionet_data.operations.moments import NAMED, relation, runs_of
from scenarionet_data.query import pair_kernels as kernels
from scenarionet_data.query.lake_view import LakeView
from scenarionet_data.query.pair_kernels import LinkedLanes, PairStates, find_spans

_DIRECTIONS = {"forward": (1, 0), "left": (0, 1), "backward": (-1, 0), "right": (0, -1)}
_ANGLES = {"same": (0, 45), "opposite": (135, inf), "perpendicular": (45, 135)}
_SIDES = {"same": kernels.SAME_SIDE, "opposite": kernels.OPPOSITE_SIDE}
_ROUNDS = {"either": 0, "counterclockwise": 1, "clockwise": -1}
_NO_LINKS = LinkedLanes(*(np.zeros(count, np.int64) for count in (1, 0, 0)))
_NUMBERED = (
    "(SELECT dataset, version, map_id, lane_id, row_number() OVER (ORDER BY dataset, version, map_id, lane_id) - 1 AS "
    "lane FROM lane_outlines)"
)
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
SELECT n.lane, o.lane AS other, bit_or(kind) AS kind
FROM links JOIN {_NUMBERED} AS n USING (dataset, version, map_id, lane_id) JOIN {_NUMBERED} AS o ON
    o.dataset = n.dataset AND o.version = n.version AND o.map_id = n.map_id AND o.lane_id = other_lane_id
GROUP BY ALL ORDER BY ALL
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
    def _owners(self) -> pa.Table:
        along_x = "min(least(x, box_x) - radius), max(greatest(x, box_x) + radius)"
        return self._view.arrow(
            f"SELECT scenario_id, track_id, count(*), {along_x}, {along_x.replace('x, box_x', 'y, box_y')} "
            "FROM smoothed GROUP BY ALL ORDER BY ALL"
        )

    @cached_property
    def _states(self) -> PairStates:
        columns = [name for name in PairStates._fields[5:] if name != "walks"]
        rows = self._view.arrow(
            f"SELECT timestep::BIGINT AS timestep, {', '.join(columns)}, "
            "coalesce(object_type IN ('VEHICLE', 'PEDESTRIAN', 'CYCLIST'), false) AS walks\n"
            "FROM smoothed ORDER BY scenario_id, track_id, smoothed.timestep"
        ).combine_chunks()  # chunks would be joined to arrays that can be written to, of another type for kernels
        _, tracks = np.unique(self._owners["scenario_id"].to_numpy(), return_counts=True)
        return PairStates(
            _ends(tracks),
            _ends(self._owners[2].to_numpy()),
            np.stack([self._owners[edge].to_numpy() for edge in range(3, 7)], axis=1),
            rows["timestep"].to_numpy(),
            rows["timestep"].to_numpy()[:0],  # no lanes
            *(rows[name].to_numpy() for name in (*columns, "walks")),
        )

    @cached_property
    def _lanes(self) -> Int64:
        keys = "scenario_id, track_id, timestep"
        lanes_of = f"FROM object_lanes JOIN {_NUMBERED} AS numbered USING (dataset, version, map_id, lane_id)"
        sql = f"SELECT coalesce(lane, -1) AS lane FROM smoothed LEFT JOIN ({lanes_of}) USING ({keys}) ORDER BY {keys}"
        lanes: Int64 = self._view.arrow(sql).combine_chunks()["lane"].to_numpy()
        return lanes

    @cached_property
    def _links(self) -> LinkedLanes:
        rows = self._view.arrow(_LINKS)
        lanes, others, kinds = (rows[name].to_numpy().astype(np.int64) for name in ("lane", "other", "kind"))
        return LinkedLanes(_ends(np.bincount(lanes, minlength=max(others, default=0) + 1)), others, kinds)


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
