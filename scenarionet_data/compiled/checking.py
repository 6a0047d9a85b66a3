"""Calls of kernels that skip the comparison of argument types, and the check of such calls in the tests."""

from __future__ import annotations

import os
from functools import partial
from importlib import import_module
from typing import Any, cast

from scenarionet_data.compiled.decorators import Function
from scenarionet_data.compiled.gate import import_numba

CHECK = "SCENARIONET_CHECK_KERNELS"
"""Environment variable; 1 compares the arguments of every call through ``unchecked``."""

_IS_CHECKING = os.environ.get(CHECK) == "1"


def unchecked(function: Function) -> Function:
    """Return the entry of a kernel without type dispatch. UNSAFE: other dtypes, ranks or strides give wrong results.

    For call sites that measure a gain of 5 % in a benchmark of their flow, and make all arguments themselves. A call
    with many arrays takes a third of the time. Before the first call, the entry is the kernel itself.

    With ``SCENARIONET_CHECK_KERNELS=1``, as in the tests, a call raises a TypeError if its arguments are not those that
    the kernel was compiled for, or if the kernel was compiled for others as well.
    """
    if _IS_CHECKING:
        return cast(Function, partial(_checked_call, function))
    return getattr(function, "only_entry", function)


def _checked_call(function: Any, *arguments: Any) -> Any:
    numba = import_numba()
    name = getattr(function, "__qualname__", repr(function))
    for signature in getattr(function, "signatures", [])[:1]:
        for place, (value, expected) in enumerate(zip(arguments, signature, strict=True)):
            found = numba.typeof(value)
            if not _fits(found, expected):
                raise TypeError(f"{name}(): argument {place} is {found}, but the kernel was compiled for {expected}")
    result = getattr(function, "only_entry", function)(*arguments)
    if len(getattr(function, "signatures", [])) > 1:
        raise TypeError(f"{name}() was compiled for several types; call it without unchecked: {function.signatures}")
    return result


def _fits(found: Any, expected: Any) -> bool:
    """Return whether machine code for one type reads a value of another as it is."""
    types: Any = import_module("numba.core.types")
    if isinstance(expected, types.Array) and isinstance(found, types.Array):
        return (
            (found.dtype, found.ndim, found.aligned) == (expected.dtype, expected.ndim, expected.aligned)
            and expected.layout in ("A", found.layout)
            and (found.mutable or not expected.mutable)
        )
    if isinstance(expected, types.BaseTuple) and isinstance(found, types.BaseTuple):
        return (
            getattr(found, "instance_class", None) is getattr(expected, "instance_class", None)
            and len(found) == len(expected)
            and all(map(_fits, found, expected))
        )
    return bool(found == expected)
