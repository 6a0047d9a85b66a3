"""Compiled loop of decoding lights: one call checks the rows of a scenario and fills its arrays."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.columns import FIRST, LENGTHS, OFFSETS, ColumnBlock
from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.codec.copy_kernels import copy_codes, copy_flags
from scenarionet_data.codec.part_kernels import PartPlan, copy_texts
from scenarionet_data.compiled.byte_views import as_float32, as_int32
from scenarionet_data.compiled.decorators import kernel


@kernel(nogil=True, allocates=False)
def fill_lights(
    block: ColumnBlock,
    plan: PartPlan,
    first: int,
    last: int,
    steps: int,
    codes: tuple[Array, Array],
    memory: Array,
    places: Array,
) -> int:
    """Fill a scenario's lights.

    Args:
        block: Rows of lights.
        plan: Columns and arrays of ``StoredLights``.
        first, last: Rows of the scenario.
        steps: Its number of timesteps.
        codes: uint8 code of each word of state and provenance.
        memory: uint8, filled; known stop points without a height have z = 0, like all other coordinates.
        places: Those of the arrays of ``StoredLights``.

    Returns:
        Place in the plan's columns of the first that does not match the timesteps of the scenario, or their number.
    """
    columns = plan.columns
    values, integers = as_float32(block.memory), as_int32(block.memory)
    for row in range(first, last):
        if integers[block.columns[columns[3], LENGTHS] + row] != steps:
            return 3
    points = as_float32(memory)[places[2] >> 2 : places[3] >> 2]
    for row in range(last - first):
        for axis in range(3):
            points[3 * row + axis] = values[block.columns[columns[axis], FIRST] + first + row]
        if np.isnan(points[3 * row + 2]) and not np.isnan(points[3 * row]):
            points[3 * row + 2] = 0
    first_state = integers[block.columns[columns[3], OFFSETS] + first]
    copy_codes(block, columns[3], first_state, codes[0], memory[places[3] : places[4]])
    copy_flags(block, columns[4], first, memory[places[4] : places[5]])
    copy_codes(block, columns[5], first, codes[1], memory[places[5] : places[6]])
    copy_texts(block, plan, first, last, memory, places)
    return len(columns)
