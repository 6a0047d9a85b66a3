"""Bytes as numbers in compiled loops: Numba's ``view`` does the same, and takes half a second to compile."""

from __future__ import annotations

from functools import partial
from importlib import import_module
from typing import Any

import numpy as np

from scenarionet_data.compiled.declared import instruction
from scenarionet_data.compiled.decorators import device_function
from scenarionet_data.compiled.gate import uses_internals


def _view(dtype: Any) -> Any:
    """Return a function for the memory of an array of bytes as numbers; the size is a multiple of theirs."""
    if not uses_internals():
        return device_function(allocates=True)(lambda data: data.view(dtype))
    types: Any = import_module("numba.core.types")
    populate: Any = import_module("numba.np.arrayobj").populate_array
    width, kind = np.dtype(dtype).itemsize, types.Array(getattr(types, np.dtype(dtype).name), 1, "C")

    def view(_: Any, data: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            source = context.make_array(signature.args[0])(context, builder, arguments[0])
            found, size = context.make_array(kind)(context, builder), context.get_constant(types.intp, width)
            populate(
                found,
                data=builder.bitcast(source.data, found.data.type),
                shape=[builder.udiv(source.nitems, size)],
                strides=[size],
                itemsize=size,
                meminfo=source.meminfo,
            )
            return found._getvalue()

        return kind(data), generate

    return import_module("numba.extending").intrinsic(view)


as_float32, as_int32, as_int64 = (instruction(partial(_view, dtype)) for dtype in (np.float32, np.int32, np.int64))
