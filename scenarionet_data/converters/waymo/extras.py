"""Write the extras of map features as JSON text in compiled code.

The text equals ``canonical_json.to_json`` of the rows of ``boundary_segments``; building a dictionary per boundary
would take longer than the rest of a record.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Int64, Object
from scenarionet_data.compiled.decorators import device_function, kernel
from scenarionet_data.converters.waymo.wire import WaymoWireMap

_LONGEST_ROW = 6 * 21 + 20  # six numbers of 20 characters and a comma, and the brackets and keys around them
_NAMES = tuple(
    np.frombuffer(name, np.uint8)
    for name in (
        b'"interpolating":true',
        b'"left_boundaries":[',
        b'"left_neighbor":[',
        b'"right_boundaries":[',
        b'"right_neighbor":[',
    )
)


def write_extras(features: WaymoWireMap, boundary_codes: Int64) -> Object:
    """(M,) JSON text per feature, None if it has no extras.

    Args:
        features: A record's map.
        boundary_codes: ``MapFeatureType`` by the source's boundary type.
    """
    left = features.left_boundaries, features.left_neighbors, features.left_neighbor_boundaries
    right = features.right_boundaries, features.right_neighbors, features.right_neighbor_boundaries
    count = len(features.is_interpolating)
    text = np.empty(_LONGEST_ROW * sum(map(len, left + right)) + 100 * count + 1, np.uint8)
    ends = np.zeros(count + 1, np.int64)
    _write(features.is_interpolating, left, right, boundary_codes, _NAMES, text, ends)
    whole, bounds = text[: ends[-1]].tobytes().decode("ascii"), ends.tolist()
    parts = [whole[start:end] or None for start, end in pairwise(bounds)]
    return np.array(parts, dtype=object)


@kernel
def _write(
    flags: Array,
    left: tuple[Array, Array, Array],
    right: tuple[Array, Array, Array],
    codes: Array,
    names: tuple[Array, ...],
    text: Array,
    ends: Array,
) -> None:
    """Write the texts of all features; the text of feature ``i`` ends at ``ends[i + 1]``.

    The tables of a side are its boundaries, its neighbours and their boundaries. The first column of a table is the
    feature (in the last one: the row of the neighbour), ascending.
    """
    at = 0
    done = np.zeros((2, 3), np.int64)  # next row of each table
    for row in range(len(flags)):
        start = at
        if flags[row]:
            at = _copy(text, _between(text, at, start), names[0])
        at, done[0, 0] = _list(text, at, start, names[1], left[0], row, done[0, 0], codes)
        at = _neighbors(text, at, start, names[2], left, row, done[0], codes)
        at, done[1, 0] = _list(text, at, start, names[3], right[0], row, done[1, 0], codes)
        at = _neighbors(text, at, start, names[4], right, row, done[1], codes)
        if at > start:
            at = _put(text, at, 125)  # }
        ends[row + 1] = at


@device_function
def _list(
    text: Array, at: int, start: int, name: Array, table: Array, row: int, first: int, codes: Array
) -> tuple[int, int]:
    """Write the member with a feature's boundaries, if any; return the next positions in text and table."""
    if first >= len(table) or table[first, 0] != row:
        return at, first
    at = _copy(text, _between(text, at, start), name)
    at, first = _boundaries(text, at, table, row, first, codes)
    return _put(text, at, 93), first  # ]


@device_function
def _boundaries(text: Array, at: int, table: Array, row: int, first: int, codes: Array) -> tuple[int, int]:
    """Write rows [first point, last point, "feature", type code], separated by commas."""
    begin = first
    while first < len(table) and table[first, 0] == row:
        if first > begin:
            at = _put(text, at, 44)  # ,
        at = _number(text, _put(text, at, 91), table[first, 1])  # [
        at = _number(text, _put(text, at, 44), table[first, 2])
        at = _quoted(text, _put(text, at, 44), table[first, 3])
        at = _number(text, _put(text, at, 44), codes[table[first, 4]])
        at = _put(text, at, 93)
        first += 1
    return at, first


@device_function
def _neighbors(
    text: Array,
    at: int,
    start: int,
    name: Array,
    side: tuple[Array, Array, Array],
    row: int,
    done: Array,
    codes: Array,
) -> int:
    """Write the member with a feature's neighbours and their boundaries, if any; the next rows of tables advance."""
    table, first = side[1], done[1]
    if first >= len(table) or table[first, 0] != row:
        return at
    at = _copy(text, _between(text, at, start), name)
    begin = first
    while first < len(table) and table[first, 0] == row:
        if first > begin:
            at = _put(text, at, 44)
        at = _quoted(text, _put(text, at, 91), table[first, 1])
        for column in range(2, 6):
            at = _number(text, _put(text, at, 44), table[first, column])
        at = _put(text, _put(text, at, 44), 91)
        at, done[2] = _boundaries(text, at, side[2], first, done[2], codes)
        at = _put(text, _put(text, at, 93), 93)
        first += 1
    done[1] = first
    return _put(text, at, 93)


@device_function
def _between(text: Array, at: int, start: int) -> int:
    """Write the brace before a feature's first member, or the comma before another."""
    return _put(text, at, 123 if at == start else 44)


@device_function
def _put(text: Array, at: int, character: int) -> int:
    text[at] = character
    return at + 1


@device_function
def _copy(text: Array, at: int, word: Array) -> int:
    for place in range(len(word)):
        text[at + place] = word[place]
    return at + len(word)


@device_function
def _quoted(text: Array, at: int, number: int) -> int:
    return _put(text, _number(text, _put(text, at, 34), number), 34)


@device_function
def _number(text: Array, at: int, number: int) -> int:
    """Write the decimal digits of an int64."""
    rest = np.uint64(number)
    if number < 0:
        at = _put(text, at, 45)  # -
        rest = ~rest + np.uint64(1)
    end = at + 1
    power = rest // np.uint64(10)
    while power > 0:
        end += 1
        power //= np.uint64(10)
    for place in range(end - 1, at - 1, -1):
        text[place] = 48 + rest % np.uint64(10)
        rest //= np.uint64(10)
    return end
