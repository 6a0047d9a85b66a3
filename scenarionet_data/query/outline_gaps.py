"""How far objects are from outlines, as a function ``outline_gaps`` of SQL."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from scenarionet_data.query.lane_kernels import BoxSteps, Outlines, measure_gaps
from scenarionet_data.query.lanes_along import offsets, shifted

_LISTS = ("x", "y", "yaw_rate", "box_x", "box_y", "heading", "length", "width")
PARAMETERS = (
    f"STRUCT(origin_x DOUBLE, origin_y DOUBLE, {', '.join(f'{name} DOUBLE[]' for name in _LISTS)})",
    "STRUCT(xs DOUBLE[], ys DOUBLE[])[]",
    "BOOLEAN",
    "DOUBLE",
)
RETURNS = "DOUBLE[]"
"""Types in SQL."""


def outline_gaps(
    steps: pa.ChunkedArray, outlines: pa.ChunkedArray, is_box: pa.ChunkedArray, reach: pa.ChunkedArray
) -> pa.ListArray:
    """Return the distance of each object to the nearest of some outlines at each step.

    Args:
        steps: For each object lists of what it did at each step, see the view ``walks``.
        outlines: For each object a list of polygons near it [m].
        is_box: Whether its box counts, as recorded; or the smoothed centre of its box alone.
        reach: Largest distance that matters [m].

    Returns:
        For each step the distance [m], 0 inside; larger ones than ``reach`` may be infinite.
    """
    walked, near = steps.combine_chunks(), pc.list_flatten(outlines).combine_chunks()
    prefix, sizes = ("box_", ("heading", "length", "width")) if is_box[0].as_py() else ("", ())
    columns = [shifted(walked.field(f"{prefix}{axis}"), walked.field(f"origin_{axis}")) for axis in ("x", "y")]
    columns += [walked.field(name).flatten().to_numpy(zero_copy_only=False) for name in sizes]
    ends = offsets(walked.field("x"))
    gaps = np.empty(ends[-1])
    measure_gaps(
        BoxSteps(ends, *columns, *[np.zeros(ends[-1])] * (5 - len(columns))),
        Outlines(
            offsets(outlines),
            offsets(near.field("xs")),
            near.field("xs").flatten().to_numpy(),
            near.field("ys").flatten().to_numpy(),
        ),
        reach[0].as_py(),
        gaps,
    )
    return pa.ListArray.from_arrays(pa.array(ends, pa.int32()), pa.array(gaps))
