"""Compiled checks that the lists of different columns fit together."""

from __future__ import annotations

from scenarionet_data.arrays.columns import FIRST, LENGTHS, OFFSETS, ColumnBlock
from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.compiled.byte_views import as_int32
from scenarionet_data.compiled.decorators import device_function, kernel

EQUAL, OR_ONE, OR_NONE, OR_NEVER = range(4)
"""Lengths that a list may have: that of its span; or 1; or 0; or 0 if those of its scenario all have it."""

TRACK_LISTS = {
    **dict.fromkeys(("x", "y"), EQUAL),
    "z": OR_NEVER,  # null in scenarios without heights
    **dict.fromkeys(("heading", "vx", "vy"), EQUAL),
    **dict.fromkeys(("length", "width", "height"), OR_ONE),
    **dict.fromkeys(("valid", "is_interpolated"), OR_NONE),  # null when they are the same in the whole span
}
"""Columns of lists of tracks, and lengths that theirs may have besides that of the span."""


@kernel(nogil=True, allocates=False)
def check_spans(block: ColumnBlock, start: int, lists: int, bounds: Array, steps: Array) -> bool:
    """Whether the spans of objects are within their scenarios.

    Args:
        block: Rows of tracks.
        start: Column of the first timestep of each span.
        lists: Column of lists of the length of each span.
        bounds: (scenarios + 1,) int64 first row of each scenario, and the end of the last one.
        steps: (scenarios,) int64 number of timesteps.
    """
    for scenario in range(len(steps)):
        if not are_inside(block, start, lists, bounds[scenario], bounds[scenario + 1], steps[scenario]):
            return False
    return True


@kernel(nogil=True, allocates=False)
def check_lengths(block: ColumnBlock, likes: Array, columns: Array, others: Array, bounds: Array) -> int:
    """Compare the lengths of lists with those of other columns.

    Args:
        block: Rows of scenarios.
        likes: (n,) int64 the other column of each column.
        columns: (n,) int64 the columns.
        others: (n,) int64 other lengths that their lists may have: OR_ONE, ...
        bounds: As in :func:`check_spans`.

    Returns:
        Place in ``columns`` of the first that differs, or n.
    """
    for place in range(len(columns)):
        for scenario in range(len(bounds) - 1):
            first, last = bounds[scenario], bounds[scenario + 1]
            if not are_as_long(block, likes[place], columns[place], others[place], first, last):
                return place
    return len(columns)


@device_function
def are_inside(block: ColumnBlock, start: int, lists: int, first: int, last: int, steps: int) -> bool:
    """Whether the spans of a scenario's objects are within its timesteps."""
    integers = as_int32(block.memory)
    starts, lengths = integers[block.columns[start, FIRST] :], integers[block.columns[lists, LENGTHS] :]
    for row in range(first, last):
        begin = starts[row]
        if begin < 0 or begin + lengths[row] > steps:
            return False
    return True


@device_function
def are_as_long(block: ColumnBlock, like: int, column: int, other: int, first: int, last: int) -> bool:
    """Whether the lists of a scenario are as long as those of another column, or have another length they may have."""
    integers = as_int32(block.memory)
    wanted, lengths = integers[block.columns[like, LENGTHS] :], integers[block.columns[column, LENGTHS] :]
    offsets = integers[block.columns[column, OFFSETS] :]
    may_be_none = other == OR_NONE or (other == OR_NEVER and offsets[first] == offsets[last])
    for row in range(first, last):
        length = lengths[row]
        if length != wanted[row]:
            is_other = length == 1 if other == OR_ONE else length == 0 and may_be_none
            if not is_other:
                return False
    return True
