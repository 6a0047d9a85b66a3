"""How loops are compiled: kernels that Python calls, and device functions that only kernels call.

Numba's cache of a kernel is renewed when the kernel's own file changes, not when a device function's file does:
after editing a device function, delete ``*.nbi`` and ``*.nbc`` in ``__pycache__``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

from numba import njit

Function = TypeVar("Function", bound=Callable[..., Any])

_ENTRY: dict[str, Any] = {"cache": True, "no_cfunc_wrapper": True}
_WITHOUT_ENTRY: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}


def kernel(function: Function) -> Function:
    """Compile a function that Python calls, and keep the machine code on disk."""
    return cast(Function, njit(**_ENTRY)(function))


def device_function(function: Function) -> Function:
    """Compile a function that only compiled functions call: without a Python entry, in half the time."""
    return cast(Function, njit(**_WITHOUT_ENTRY)(function))
