"""Dispatchers of compiled functions: caching, entries without type dispatch, one specialisation for all constants.

They derive from the dispatcher inside of Numba, and are used with the versions of ``TESTED``.
"""

from __future__ import annotations

import importlib
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from numba import njit, types
from numba.core import compiler_lock, registry

from scenarionet_data.compiled.announcing import Compilation, compilations
from scenarionet_data.compiled.compiler import loop_compiler
from scenarionet_data.compiled.declared import DeclaredDeviceFunction
from scenarionet_data.compiled.kernel_cache import KernelCache
from scenarionet_data.optional_imports import hidden
from scenarionet_data.public_names import paused_collector

_njit: Any = njit  # Numba's types omit options and internals
_numba_types: Any = types
_CPUDispatcher: Any = registry.CPUDispatcher
_one_at_a_time: Any = compiler_lock.global_compiler_lock
"""Decorator and lock of Numba: one thread of the process compiles."""


def as_kernel(plain: Any, options: dict[str, Any], *, allocates: bool, is_wide: bool) -> Any:
    """Return a function as a kernel; see ``decorators.kernel``."""
    own = {} if allocates else {"pipeline_class": loop_compiler(is_wide=is_wide)}
    dispatcher = _njit(no_cfunc_wrapper=True, _nrt=allocates, **options, **own)(plain)
    if isinstance(dispatcher, _CPUDispatcher):  # a plain function under NUMBA_DISABLE_JIT
        dispatcher.__class__ = Kernel
    return dispatcher


def as_device_function(plain: Any, options: dict[str, Any], *, allocates: bool, in_lanes: bool) -> Any:
    """Return a function as a device function; see ``decorators.device_function``."""
    own = {} if allocates else {"pipeline_class": loop_compiler(in_lanes=in_lanes)}
    dispatcher = _njit(no_cpython_wrapper=True, no_cfunc_wrapper=True, _nrt=allocates, **options, **own)(plain)
    if isinstance(dispatcher, _CPUDispatcher):
        dispatcher.__class__ = DeviceFunction
    return dispatcher


class CompiledFunction(_CPUDispatcher):  # type: ignore[misc]
    """A function that Numba compiles once for each combination of argument types."""

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """Resolve a call from a kernel; constant arguments do not create separate specialisations."""
        plain = {name: _numba_types.unliteral(kind) for name, kind in dict(kws).items()}
        return super().get_call_template(tuple(map(_numba_types.unliteral, args)), plain)


class Kernel(CompiledFunction):
    """A compiled function with a cache on disk.

    Attributes:
        only_entry: See ``checking.unchecked``.
    """

    only_entry: Callable[..., Any]

    _is_cache_open = False

    @_one_at_a_time  # type: ignore[untyped-decorator]
    def compile(self, sig: Any) -> Any:
        """Compile for one signature, or read the cache; threads wait, or they close each other's lock on files."""
        if not self._is_cache_open:  # late, as the stamp needs functions defined further down in the module
            self._is_cache_open = True
            with suppress(RuntimeError):  # no folder to write to: compile in every process
                self._cache = KernelCache(self)
        _load_array_functions()
        begin, known, hits = time.process_time(), len(self.overloads), sum(self._cache_hits.values())
        try:
            with paused_collector():
                entry = super().compile(sig)
        finally:
            if isinstance(self._cache, KernelCache):
                self._cache.unlock()
        if len(self.overloads) > known:
            entries = [result.entry_point for result in self.overloads.values()]
            self.only_entry = entries[0] if len(entries) == 1 else self
            from_cache = sum(self._cache_hits.values()) > hits
            name = f"{self.py_func.__module__}.{self.py_func.__qualname__}"
            seconds = time.process_time() - begin
            compilations.append(Compilation(name, seconds, from_cache, self._cache.cache_path))
        return entry


def _load_array_functions() -> None:
    """Import Numba's array functions without SciPy, where neither is imported yet.

    They import ``scipy.linalg`` if they find it, which takes 0.3 s, to have another ``np.cov`` and ``np.corrcoef``.
    """
    with hidden("scipy", "scipy.linalg", "scipy.linalg.cython_blas"):
        importlib.import_module("numba.np.arraymath")


class DeviceFunction(CompiledFunction):
    """A compiled function without an entry for Python."""

    __call__ = DeclaredDeviceFunction.__call__

    def compile(self, sig: Any) -> Any:
        """Compile for one signature as part of a kernel."""
        entry = super().compile(sig)
        if not self.targetoptions["_nrt"]:
            for result in self.overloads.values():
                if not _is_number(result.signature.return_type):
                    raise TypeError(
                        f"{self.py_func.__qualname__}() returns {result.signature.return_type}: "
                        "declare it as @device_function(allocates=True)"
                    )
        return entry


def _is_number(kind: Any) -> bool:
    if isinstance(kind, _numba_types.BaseTuple):
        return all(_is_number(member) for member in kind)
    plain = ("Number", "Boolean", "Literal", "Record", "NoneType")
    return isinstance(kind, tuple(getattr(_numba_types, name) for name in plain))
