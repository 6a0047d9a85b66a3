"""Compiled loops that copy values of columns to the arrays of a scenario; kernels of all its parts use them."""

from __future__ import annotations

from typing import Any

from scenarionet_data.arrays.columns import FIRST, OFFSETS, ColumnBlock
from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.compiled.byte_views import as_float32, as_int32
from scenarionet_data.compiled.decorators import device_function


@device_function
def element(block: ColumnBlock, column: int, row: int) -> Any:
    """Place of the first element of a list."""
    return block.columns[column, FIRST] + as_int32(block.memory)[block.columns[column, OFFSETS] + row]


@device_function
def join_points(block: ColumnBlock, columns: Array, row: int, count: Any, points: Array) -> None:
    """Fill points, (3 * n,), with their coordinates from a row on."""
    x, y, z = element(block, columns[0], row), element(block, columns[1], row), element(block, columns[2], row)
    numbers = as_float32(block.memory)
    _interleave(numbers[x : x + count], numbers[y : y + count], numbers[z : z + count], points)


@device_function(in_lanes=True)
def _interleave(x: Array, y: Array, z: Array, points: Array) -> None:
    for k in range(len(x)):
        points[3 * k] = x[k]
        points[3 * k + 1] = y[k]
        points[3 * k + 2] = z[k]


@device_function(in_lanes=True)
def copy(values: Array, target: Array) -> None:
    """Fill an array with values of another one."""
    for k in range(len(values)):
        target[k] = values[k]


@device_function
def copy_codes(block: ColumnBlock, column: int, first: int, codes: Array, out: Array) -> None:
    """Fill codes of the words from an element on."""
    words = as_int32(block.memory)[block.columns[column, FIRST] + first :]
    for k in range(len(out)):
        out[k] = codes[words[k]]


@device_function
def copy_flags(block: ColumnBlock, column: int, first: int, out: Array) -> None:
    """Fill truth values from an element on."""
    bits = block.memory[block.columns[column, FIRST] + first :]
    for k in range(len(out)):
        out[k] = bits[k] != 0
