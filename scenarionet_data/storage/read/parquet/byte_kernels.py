"""Access to several bytes of an array at once, which compiled loops over bytes do not get from the compiler.

Nothing is compared with the bounds of the array.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

_types: Any = types  # numba has no types of its own
_intrinsic: Any = intrinsic


def pointer_to(context: Any, builder: Any, kind: Any, array: Any, at: Any, value: Any) -> Any:
    """Address of a value of an LLVM type at a position in an array of bytes."""
    data = context.make_array(kind)(context, builder, array).data
    return builder.bitcast(builder.gep(data, [at]), value.as_pointer())


def _load(bits: int, kind: Any) -> Any:
    """Reader of little-endian numbers of some bits."""

    def load(_: Any, data: Any, at: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            array, place = arguments
            pointer = pointer_to(context, builder, signature.args[0], array, place, ir.IntType(bits))
            return builder.zext(builder.load(pointer, align=1), ir.IntType(64))

        return kind(data, at), generate

    return _intrinsic(load)


def _copy(size: int) -> Any:
    """Copier of some bytes, which are read before any of them is written."""

    def copy(_: Any, target: Any, to: Any, source: Any, at: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            block = ir.IntType(8 * size)
            written, first, read, place = arguments
            found = pointer_to(context, builder, signature.args[2], read, place, block)
            wanted = pointer_to(context, builder, signature.args[0], written, first, block)
            builder.store(builder.load(found, align=1), wanted, align=1)
            return context.get_dummy_value()

        return _types.void(target, to, source, at), generate

    return _intrinsic(copy)


def _store(_: Any, target: Any, to: Any, value: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array, place, number = arguments
        pointer = pointer_to(context, builder, signature.args[0], array, place, ir.IntType(64))
        builder.store(number, pointer, align=1)
        return context.get_dummy_value()

    return _types.void(target, to, value), generate


def _trailing_zeros(_: Any, value: Any) -> Any:
    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return builder.cttz(arguments[0], ir.Constant(ir.IntType(1), 1))

    return _types.int64(value), generate


byte_at = _load(8, _types.int64)
short_at = _load(16, _types.int64)
word_at = _load(32, _types.int64)
double_at = _load(64, _types.uint64)
copy_8, copy_16, copy_32 = _copy(8), _copy(16), _copy(32)
store_8 = _intrinsic(_store)
trailing_zeros = _intrinsic(_trailing_zeros)
"""Number of bits below the lowest one that is set, of a uint64 that is not 0."""
