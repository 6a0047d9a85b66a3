"""Items shared out to threads while they run.

Each thread has a range of items and takes those first, so that what it reads and writes stays in the cache of its core.
Then it takes what is left of the ranges of others: items differ in cost, and threads begin at different times.

A kernel that shares items out is called by a leader in every turn, and once by each helper, which then waits inside of
it for turns: to wake a sleeping thread takes as long as several worlds. The kernel is a loop over turns::

    if own == LEADER:
        keep(team, arguments)
    turn = begin(team, own, 0)
    while turn:
        given = kept(team, arguments)
        item = take(team.ranges, own)
        while item >= 0:
            ...
            item = take(team.ranges, own)
        turn = end(team, own, turn, result)

The leader waits for nobody: helpers that come too late find nothing to do, or a turn that has ended.
"""

from __future__ import annotations

import platform
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from scenarionet_data.arrays.dtypes import Int64
from scenarionet_data.compiled.decorators import device_function

_types: Any = types  # numba has no types of its own
_intrinsic: Any = intrinsic
_cgutils: Any = cgutils

LEADER = 0
"""The thread that calls the kernel in every turn."""

_NEXT, _FIRST, _END = range(3)
"""Columns of ranges: the next item, the first one, the end. A row fills a cache line, since processors exchange whole
lines."""

JOIN, STAY_OUT, LEAVE = range(3)
"""What helpers do: join turns, wait without joining any, or leave the kernel as soon as they have ended their turn."""

_TURN, _ORDER, _RESULT = range(3)
"""Rows of a gate. The first column of the first one counts the turns, says whether the current one is open, and counts
the helpers in it."""

_OPEN, _HELPERS, _SHIFT = 1 << 15, (1 << 15) - 1, 16
_PATIENCE = 1 << 14
"""Pauses of some 20 to 50 ns that a helper waits for a turn."""

STAY = 256
"""Turns after which a helper leaves the kernel, and so drops the arrays that it was called with."""

_ROOM = 4096
"""Words for the arguments of a turn."""


class Team(NamedTuple):
    """What the threads of a kernel share.

    Attributes:
        ranges: (T, 8) items by thread, see :func:`ranges_of`.
        gate: (3, 8) the current turn, what helpers do, and the largest result.
        arguments: Words of the arguments of the current turn.
    """

    ranges: Int64
    gate: Int64
    arguments: Int64

    @classmethod
    def of(cls, total: int, count: int) -> Team:
        """Return a team of ``count`` threads for ``total`` items."""
        return cls(ranges_of(total, count), np.zeros((3, 8), np.int64), np.zeros(_ROOM, np.int64))

    @property
    def is_helped(self) -> bool:
        """Whether helpers are still in the last turn."""
        return bool(self.gate.item(_TURN, 0) & _HELPERS)

    @property
    def turn(self) -> int:
        """Number of the current turn, or of the last one."""
        return self.gate.item(_TURN, 0) >> _SHIFT

    @property
    def awaits_helpers(self) -> bool:
        """Whether helpers shall join a turn, which has begun."""
        return self.gate.item(_ORDER, 0) == JOIN and bool(self.gate.item(_TURN, 0) & _OPEN)

    @property
    def result(self) -> int:
        """Largest result of any thread in the last turn."""
        return self.gate.item(_RESULT, 0)

    def order(self, order: int) -> None:
        """Let helpers do something else from now on: see ``JOIN``."""
        self.gate[_ORDER, 0] = order


def ranges_of(total: int, count: int) -> Int64:
    """Return ``count`` consecutive ranges (count, 8) of ``total`` items, for :func:`take`."""
    ranges = np.zeros((count, 8), np.int64)
    for own in range(count):  # of few threads: NumPy takes four times as long
        first = own * total // count
        ranges[own, : _END + 1] = first, first, (own + 1) * total // count
    return ranges


@device_function
def begin(team: Team, own: int, ended: int) -> int:
    """Begin a turn: the leader opens the next one, a helper waits for one.

    Args:
        team: The team.
        own: Number of the thread.
        ended: The thread's last turn; 0 for none.

    Returns:
        The turn, from 1; 0 if none comes, or if helpers shall leave.
    """
    if own == LEADER:
        for row in range(len(team.ranges)):
            team.ranges[row, _NEXT] = team.ranges[row, _FIRST]
        team.gate[_RESULT, 0] = -1
        turn: int = (_read(team.gate, _TURN) >> _SHIFT) + 1
        _add(team.gate, _TURN, (1 << _SHIFT) + _OPEN)
        return turn
    for _ in range(_PATIENCE):
        order = _read(team.gate, _ORDER)
        if order == LEAVE:
            return 0
        gate: int = _read(team.gate, _TURN)
        is_new = gate & _OPEN and gate >> _SHIFT != ended
        if order == JOIN and is_new and _replace(team.gate, _TURN, gate, gate + 1):
            return gate >> _SHIFT
        _pause()
    return 0


@device_function
def end(team: Team, own: int, turn: int, result: int) -> int:
    """End a turn with the result of this thread; return the next turn, or 0: see :func:`begin`."""
    _raise_to(team.gate, _RESULT, result)
    if own == LEADER:
        _add(team.gate, _TURN, -_OPEN)
        return 0
    _add(team.gate, _TURN, -1)
    return begin(team, own, turn) if turn % STAY else 0


@device_function
def take(ranges: Int64, own: int) -> int:
    """Return an item that no other thread takes, of the thread's own range as long as it has any; -1 if none is left.

    Args:
        ranges: (T, 8) see :func:`ranges_of`; changed by every call.
        own: Range of the thread.
    """
    for k in range(len(ranges)):
        row = (own + k) % len(ranges)
        if ranges[row, _NEXT] < ranges[row, _END]:
            item: int = _add(ranges, row, 1)
            if item < ranges[row, _END]:
                return item
    return -1


@_intrinsic
def keep(_: Any, team: Any, arguments: Any) -> Any:
    """Keep the arguments of a turn for all threads."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        builder.store(values[1], _kept_at(context, builder, signature, values))
        return context.get_dummy_value()

    return _types.void(team, arguments), generate


@_intrinsic
def kept(_: Any, team: Any, arguments: Any) -> Any:
    """Return what was kept last, of the same types as ``arguments``."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return builder.load(_kept_at(context, builder, signature, values))

    return arguments(team, arguments), generate


def _kept_at(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    """Return where a team keeps its arguments, as a pointer."""
    kind = context.get_value_type(signature.args[1])
    if context.get_abi_sizeof(kind) > 8 * _ROOM:
        raise ValueError(f"the arguments of a turn need more than {_ROOM} words; raise _ROOM in threads/sharing.py")
    words = signature.args[0].fields.index("arguments")
    array = context.make_array(signature.args[0].types[words])(
        context, builder, builder.extract_value(values[0], words)
    )
    return builder.bitcast(array.data, kind.as_pointer())


@_intrinsic
def _read(_: Any, words: Any, row: Any) -> Any:
    """Read the first word of a row, which other threads write."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return builder.load_atomic(_first_word(context, builder, signature, values), "seq_cst", 8)

    return _types.int64(words, row), generate


@_intrinsic
def _add(_: Any, words: Any, row: Any, number: Any) -> Any:
    """Add a number to the first word of a row at one moment for all threads; return the word before."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        more = context.cast(builder, values[2], number, _types.int64)
        return builder.atomic_rmw("add", _first_word(context, builder, signature, values), more, "seq_cst")

    return _types.int64(words, row, number), generate


@_intrinsic
def _raise_to(_: Any, words: Any, row: Any, number: Any) -> Any:
    """Raise the first word of a row to a number if it is less, at one moment for all threads."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        least = context.cast(builder, values[2], number, _types.int64)
        builder.atomic_rmw("max", _first_word(context, builder, signature, values), least, "seq_cst")
        return context.get_dummy_value()

    return _types.void(words, row, number), generate


@_intrinsic
def _replace(_: Any, words: Any, row: Any, old: Any, new: Any) -> Any:
    """Replace the first word of a row unless it has changed, at one moment for all threads; return whether it did."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        place = _first_word(context, builder, signature, values)
        before, after = (context.cast(builder, values[k], kind, _types.int64) for k, kind in ((2, old), (3, new)))
        return builder.extract_value(builder.cmpxchg(place, before, after, "seq_cst", "seq_cst"), 1)

    return _types.boolean(words, row, old, new), generate


@_intrinsic
def _pause(_: Any) -> Any:
    """Leave the core to its other thread for a moment."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        del signature, values
        if platform.machine().lower() in _X86:
            kind = ir.FunctionType(ir.VoidType(), [])
            builder.call(_cgutils.get_or_insert_function(builder.module, kind, "llvm.x86.sse2.pause"), [])
        return context.get_dummy_value()

    return _types.void(), generate


_X86 = ("x86_64", "amd64")


def _first_word(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    """Return a pointer to the first word of a row."""
    kind = signature.args[0]
    array = context.make_array(kind)(context, builder, values[0])
    row = context.cast(builder, values[1], signature.args[1], _types.intp)
    return _cgutils.get_item_pointer(context, builder, kind, array, [row, ir.Constant(ir.IntType(64), 0)])
