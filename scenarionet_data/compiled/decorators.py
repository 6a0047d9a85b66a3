"""Compilation with Numba: kernels, which Python calls, and device functions, which only kernels call.

All compiled functions of both packages use these two decorators. The machine code of kernels is cached on disk:
in ``NUMBA_CACHE_DIR`` where set, else in ``__pycache__`` next to the source, else (read-only installations) in the
user's cache folder. A cached kernel is valid as long as its code, that of every device function it calls, and the
constants they read are unchanged, so editing any of these recompiles it. Processes that need the same kernel at
once wait for the first one to compile it.

Importing a module with kernels of this package does not import Numba; their first calls may do without, see ``bare``.

Versions of Numba that were not tested compile and cache by themselves, see ``gate``.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from typing import Any, TypeVar, cast, overload

from scenarionet_data.compiled import bare
from scenarionet_data.compiled.declared import DeclaredDeviceFunction, DeclaredKernel
from scenarionet_data.compiled.gate import uses_internals

_COMMON = {"nopython": True, "boundscheck": None, "no_cfunc_wrapper": True}
"""Options that Numba knows of all compiled functions."""

Function = TypeVar("Function", bound=Callable[..., Any])


@overload
def kernel(function: Function) -> Function: ...
@overload
def kernel(
    *, allocates: bool = True, nogil: bool = False, divides_by_zero: bool = False, is_wide: bool = False
) -> Callable[[Function], Function]: ...
def kernel(
    function: Any = None,
    *,
    allocates: bool = True,
    nogil: bool = False,
    divides_by_zero: bool = False,
    is_wide: bool = False,
) -> Any:
    """Compile a function that Python calls on its first call, and cache the machine code on disk.

    Args:
        function: Called with arrays, numbers, and NamedTuples of these.
        allocates: Count references, which kernels that create or return arrays need; others compile faster without.
        nogil: Release the interpreter lock while it runs, for use in threads.
        divides_by_zero: Division by 0 gives infinity or NaN instead of an exception, so that the processor can divide
            several numbers at once.
        is_wide: Loops of the device functions in lanes that it calls are long: they use vectors of 64 bytes where
            these are no slower. It must not allocate.
    """

    def decorate(plain: Function) -> Function:
        options = {"nogil": nogil, "error_model": "numpy" if divides_by_zero else "python"}

        def make() -> Any:
            if uses_internals():
                dispatchers: Any = import_module("scenarionet_data.compiled.dispatchers")
                return dispatchers.as_kernel(plain, options, allocates=allocates, is_wide=is_wide)
            # kernels that count references crash
            compiled = import_module("numba").njit(_nrt=allocates, **options)(plain)
            with suppress(AttributeError, RuntimeError):  # NUMBA_DISABLE_JIT; no folder to write to
                compiled.enable_caching()
            return compiled

        known = options | _COMMON | {"_nrt": allocates}
        return cast(Function, DeclaredKernel(plain, known, make) if _waits(plain) else make())

    return decorate if function is None else decorate(function)


@overload
def device_function(function: Function) -> Function: ...
@overload
def device_function(
    *,
    allocates: bool = False,
    nogil: bool = False,
    forceinline: bool = False,
    divides_by_zero: bool = False,
    in_lanes: bool = False,
) -> Callable[[Function], Function]: ...
def device_function(
    function: Any = None,
    *,
    allocates: bool = False,
    nogil: bool = False,
    forceinline: bool = False,
    divides_by_zero: bool = False,
    in_lanes: bool = False,
) -> Any:
    """Compile a function that only kernels call: without reference counts and a Python entry, in half the time.

    Args:
        function: Works on its arguments; calling it from Python raises TypeError.
        allocates: Count references, which functions that create or return arrays need.
        nogil: As the kernel that calls it.
        forceinline: Inline the machine code regardless of its size.
        divides_by_zero: As the kernel that calls it.
        in_lanes: Compute several elements of its loops at once: no memory that it writes to is reached by two of its
            arguments, its constants are float32 instead of float64, and no index is below 0. Products are added
            without being rounded before, where the processor can do so.
    """
    options: dict[str, Any] = {"nogil": nogil, "error_model": "numpy" if divides_by_zero else "python"}
    if forceinline:
        options["forceinline"] = True

    def decorate(plain: Function) -> Function:
        def make() -> Any:
            if uses_internals():
                dispatchers: Any = import_module("scenarionet_data.compiled.dispatchers")
                return dispatchers.as_device_function(plain, options, allocates=allocates, in_lanes=in_lanes)
            return import_module("numba").njit(_nrt=allocates, **options)(plain)

        known = options | _COMMON | {"_nrt": allocates, "no_cpython_wrapper": True}
        return cast(Function, DeclaredDeviceFunction(plain, known, make) if _waits(plain) else make())

    return decorate if function is None else decorate(function)


def _waits(plain: Callable[..., Any]) -> bool:
    """Whether Numba is imported when the function is called."""
    return "numba" not in sys.modules and bare.is_of_data(plain)
