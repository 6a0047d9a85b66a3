"""Bytes as numbers in compiled loops: Numba's ``view`` does the same, and takes half a second to compile."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types
from numba.extending import intrinsic
from numba.np import arrayobj

from scenarionet_data.compiled.decorators import device_function
from scenarionet_data.compiled.gate import uses_internals

_types: Any = types  # numba has no types of its own
_intrinsic: Any = intrinsic
_populate: Any = arrayobj.populate_array


def _view(dtype: Any) -> Any:
    """Return a function for the memory of an array of bytes as numbers; the size is a multiple of theirs."""
    if not uses_internals():
        return device_function(allocates=True)(lambda data: data.view(dtype))
    width, kind = np.dtype(dtype).itemsize, _types.Array(getattr(_types, np.dtype(dtype).name), 1, "C")

    def view(_: Any, data: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            source = context.make_array(signature.args[0])(context, builder, arguments[0])
            found, size = context.make_array(kind)(context, builder), context.get_constant(_types.intp, width)
            _populate(
                found,
                data=builder.bitcast(source.data, found.data.type),
                shape=[builder.udiv(source.nitems, size)],
                strides=[size],
                itemsize=size,
                meminfo=source.meminfo,
            )
            return found._getvalue()

        return kind(data), generate

    return _intrinsic(view)


as_float32, as_int32, as_int64 = _view(np.float32), _view(np.int32), _view(np.int64)
