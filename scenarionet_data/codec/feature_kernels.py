"""Compiled loops over map features: one call checks the rows of a scenario and fills its arrays.

It takes for granted that the rows are consistent in themselves, as all blocks are; lists of different columns may
differ in length, which is checked before they are read.
"""

from __future__ import annotations

from scenarionet_data.arrays.columns import FIRST, LENGTHS, OFFSETS, ColumnBlock
from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.codec.check_kernels import OR_NONE, are_as_long
from scenarionet_data.codec.copy_kernels import copy_codes, element, join_points
from scenarionet_data.codec.part_kernels import PartPlan, copy_texts
from scenarionet_data.compiled.byte_views import as_float32, as_int32
from scenarionet_data.compiled.decorators import device_function, kernel


@kernel(nogil=True, allocates=False)
def fill_features(
    block: ColumnBlock,
    plan: PartPlan,
    first: int,
    last: int,
    steps: int,  # noqa: ARG001
    codes: tuple[Array],
    memory: Array,
    places: Array,
) -> int:
    """Fill a scenario's map features: lists of points from lists of their coordinates; without these, they are 0.

    Args:
        block: Rows of maps.
        plan: Columns and arrays of ``StoredFeatures``.
        first, last: Rows of the scenario.
        steps: Not used; all parts of a scenario are filled with the same arguments.
        codes: uint8 code of each word of feature_type.
        memory: uint8, filled.
        places: Those of the arrays of ``StoredFeatures``.

    Returns:
        Place in the plan's columns of the first whose lists do not match its polylines, or their number.
    """
    columns = plan.columns
    for place in range(8):
        if not are_as_long(block, columns[place - place % 3], columns[place], OR_NONE, first, last):
            return place
    numbers, integers = as_float32(memory), as_int32(memory)
    for kind in range(3):
        offsets = integers[places[6 + kind] >> 2 : places[7 + kind] >> 2]
        points = numbers[places[2 + kind] >> 2 : places[3 + kind] >> 2]
        _fill_points(block, columns[3 * kind : min(3 * kind + 3, 8)], first, offsets, points)
    speed_limit, is_intersection = numbers[places[5] >> 2 : places[6] >> 2], memory[places[10] : places[11]]
    limits, bits = block.columns[columns[8], FIRST] + first, block.columns[columns[10], FIRST] + first
    for row in range(last - first):
        speed_limit[row] = as_float32(block.memory)[limits + row]
        is_intersection[row] = block.memory[bits + row]
    copy_codes(block, columns[9], first, codes[0], memory[places[9] : places[10]])
    copy_texts(block, plan, first, last, memory, places)
    return len(columns)


@device_function
def _fill_points(block: ColumnBlock, columns: Array, first: int, offsets: Array, points: Array) -> None:
    """Fill offsets as of ``Ragged`` and points, (2 or 3 * number of points,)."""
    values, integers, width = as_float32(block.memory), as_int32(block.memory), len(columns)
    ends = integers[block.columns[columns[0], OFFSETS] + first :]
    for row in range(len(offsets)):
        offsets[row] = ends[row] - ends[0]
    is_full = width == 3
    for axis in range(width):
        place = block.columns[columns[axis], OFFSETS] + first
        found = integers[place + len(offsets) - 1] - integers[place]
        is_full &= width * found == len(points)
    if is_full:
        join_points(block, columns, first, len(points) // 3, points)
        return
    for axis in range(width):
        for row in range(len(offsets) - 1):
            start = element(block, columns[axis], first + row)
            has_values = integers[block.columns[columns[axis], LENGTHS] + first + row] > 0
            for k in range(offsets[row + 1] - offsets[row]):
                points[width * (offsets[row] + k) + axis] = values[start + k] if has_values else 0


@kernel(nogil=True)
def find_bounds(offsets: Array, points: Array, bounds: Array) -> None:
    """Extend each row's bounding box by the points of its list.

    Args:
        offsets: (M + 1,) int32, see ``Ragged``.
        points: (P, 3) float32.
        bounds: (M, 4) float32 min_x, min_y, max_x, max_y, extended; NaN without points.
    """
    for row in range(len(offsets) - 1):
        for point in range(offsets[row], offsets[row + 1]):
            for axis in range(2):
                value = points[point, axis]
                # "not >=" rather than "<": the first point replaces NaN.
                if not value >= bounds[row, axis]:
                    bounds[row, axis] = value
                if not value <= bounds[row, axis + 2]:
                    bounds[row, axis + 2] = value
