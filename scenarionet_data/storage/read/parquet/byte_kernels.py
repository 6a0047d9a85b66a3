"""Access to several bytes of an array at once, which compiled loops over bytes do not get from the compiler.

Nothing is compared with the bounds of the array.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from importlib import import_module
from typing import Any

from scenarionet_data.compiled.declared import instruction


def pointer_to(context: Any, builder: Any, kind: Any, array: Any, at: Any, value: Any) -> Any:
    """Address of a value of an LLVM type at a position in an array of bytes."""
    data = context.make_array(kind)(context, builder, array).data
    return builder.bitcast(builder.gep(data, [at]), value.as_pointer())


def _instruction(define: Callable[[Any, Any], Any]) -> Any:
    """Instruction that is defined with Numba's types and LLVM's."""

    def make() -> Any:
        defined = define(import_module("numba.core.types"), import_module("llvmlite.ir"))
        return import_module("numba.extending").intrinsic(defined)

    return instruction(make)


def _load(bits: int, name: str, types: Any, ir: Any) -> Any:
    """Reader of little-endian numbers of some bits."""
    kind = getattr(types, name)

    def load(_: Any, data: Any, at: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            array, place = arguments
            pointer = pointer_to(context, builder, signature.args[0], array, place, ir.IntType(bits))
            return builder.zext(builder.load(pointer, align=1), ir.IntType(64))

        return kind(data, at), generate

    return load


def _copy(size: int, types: Any, ir: Any) -> Any:
    """Copier of some bytes, which are read before any of them is written."""

    def copy(_: Any, target: Any, to: Any, source: Any, at: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            block = ir.IntType(8 * size)
            written, first, read, place = arguments
            found = pointer_to(context, builder, signature.args[2], read, place, block)
            wanted = pointer_to(context, builder, signature.args[0], written, first, block)
            builder.store(builder.load(found, align=1), wanted, align=1)
            return context.get_dummy_value()

        return types.void(target, to, source, at), generate

    return copy


def _store(types: Any, ir: Any) -> Any:
    def store(_: Any, target: Any, to: Any, value: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            array, place, number = arguments
            pointer = pointer_to(context, builder, signature.args[0], array, place, ir.IntType(64))
            builder.store(number, pointer, align=1)
            return context.get_dummy_value()

        return types.void(target, to, value), generate

    return store


def _trailing_zeros(types: Any, ir: Any) -> Any:
    def trailing_zeros(_: Any, value: Any) -> Any:
        def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
            return builder.cttz(arguments[0], ir.Constant(ir.IntType(1), 1))

        return types.int64(value), generate

    return trailing_zeros


byte_at = _instruction(partial(_load, 8, "int64"))
short_at = _instruction(partial(_load, 16, "int64"))
word_at = _instruction(partial(_load, 32, "int64"))
double_at = _instruction(partial(_load, 64, "uint64"))
copy_8, copy_16, copy_32 = (_instruction(partial(_copy, size)) for size in (8, 16, 32))
store_8 = _instruction(_store)
trailing_zeros = _instruction(_trailing_zeros)
"""Number of bits below the lowest one that is set, of a uint64 that is not 0."""
