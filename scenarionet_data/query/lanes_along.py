"""The lanes on which objects are, as a function ``lanes_along`` of SQL."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from scenarionet_data.arrays.dtypes import Float64, Int64
from scenarionet_data.query.lane_kernels import NearLanes, PlacedSteps, choose_lanes

_LINES = ", ".join(f"{name} DOUBLE[]" for name in ("xs", "ys", "line_xs", "line_ys"))
PARAMETERS = (
    *["DOUBLE"] * 2,
    *["DOUBLE[]"] * 3,
    f"STRUCT(turns INTEGER, is_intersection BOOLEAN, {_LINES})[]",
)
RETURNS = "STRUCT(lane INTEGER[], aside DOUBLE[])"
"""Types in SQL."""


def lanes_along(
    origin_x: pa.ChunkedArray,
    origin_y: pa.ChunkedArray,
    x: pa.ChunkedArray,
    y: pa.ChunkedArray,
    yaw_rate: pa.ChunkedArray,
    lanes: pa.ChunkedArray,
) -> pa.StructArray:
    """Return the lane that each object is on at each step; see the view ``walked_lanes``.

    Args:
        origin_x, origin_y: Origins of the frames of the objects in the frame of the lanes [m].
        x, y, yaw_rate: Lists over the steps of each object [m, rad/s].
        lanes: For each object a list of the lanes near it, by name, with outlines and centrelines [m].

    Returns:
        For each object lists over its steps: the number of the lane in this list, from 1, and how far the position is
        to the left of the lane's centreline [m]; nulls off the lanes.
    """
    near, ends = pc.list_flatten(lanes).combine_chunks(), offsets(x)
    outline, line = near.field("xs"), near.field("line_xs")
    found = np.full(ends[-1], -1)
    aside = np.zeros(ends[-1])
    choose_lanes(
        PlacedSteps(ends, shifted(x, origin_x), shifted(y, origin_y), pc.list_flatten(yaw_rate).to_numpy()),
        NearLanes(
            offsets(lanes),
            near.field("turns").to_numpy().astype(np.int64),
            pc.fill_null(near.field("is_intersection").cast(pa.int64()), -1).to_numpy(),
            offsets(outline),
            outline.flatten().to_numpy(),
            near.field("ys").flatten().to_numpy(),
            offsets(line),
            line.flatten().to_numpy(),
            near.field("line_ys").flatten().to_numpy(),
        ),
        found,
        aside,
    )
    is_off = found < 0
    columns = [pa.array(found + 1, pa.int32(), mask=is_off), pa.array(aside, mask=is_off)]
    lists = [pa.ListArray.from_arrays(pa.array(ends, pa.int32()), column) for column in columns]
    return pa.StructArray.from_arrays(lists, ["lane", "aside"])


def shifted(lists: pa.Array | pa.ChunkedArray, by: pa.Array | pa.ChunkedArray) -> Float64:
    """The elements of all lists, each shifted by the number of its list."""
    moved: Float64 = pc.list_flatten(lists).to_numpy() + np.repeat(
        by.to_numpy(), pc.list_value_length(lists).to_numpy()
    )
    return moved


def offsets(lists: pa.Array | pa.ChunkedArray) -> Int64:
    """Where each list begins among the elements of all, and where the last ends."""
    return np.append(0, np.cumsum(pc.list_value_length(lists).to_numpy())).astype(np.int64)
