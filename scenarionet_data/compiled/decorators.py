"""Compilation of array loops with Numba: kernels, which Python calls, and device functions, which only kernels call.

All compiled functions of both packages use these two decorators. The machine code of kernels is cached on disk:
in ``NUMBA_CACHE_DIR`` where set, else in ``__pycache__`` next to the source, else (read-only installations) in the
user's cache folder. A cached kernel is valid as long as its code, that of every device function it calls, and the
constants they read are unchanged, so editing any of these recompiles it. Processes that need the same kernel at
once wait for the first one to compile it.
"""

from __future__ import annotations

import gc
import hashlib
import importlib
import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from enum import EnumMeta
from multiprocessing import current_process, parent_process
from types import CodeType, FunctionType, ModuleType
from typing import Any, NoReturn, TypeVar, cast, overload

from numba import njit, types
from numba.core import caching, registry, runtime

from scenarionet_data.compiled.compiler import loop_compiler

if sys.platform != "win32":
    import fcntl

_njit: Any = njit  # Numba's types omit options and internals
_runtime: Any = runtime
_numba_types: Any = types
_CPUDispatcher: Any = registry.CPUDispatcher
_FunctionCache: Any = caching.FunctionCache
_IndexDataCacheFile: Any = caching.IndexDataCacheFile

Function = TypeVar("Function", bound=Callable[..., Any])

_PACKAGES = ("scenarionet_data", "scenarionet_sim")
_ANNOUNCED_FROM = 2.0  # [s] of processor time to compile a group
_GROUPS: tuple[tuple[str, str, int], ...] = (
    ("scenarionet_data.storage", "loading", 4),
    ("scenarionet_data.procedural", "generated traffic", 6),
    ("scenarionet_data.converters", "reading raw records", 4),
    ("scenarionet_sim", "the simulator", 8),
    ("scenarionet_data", "conversion", 4),
)
"""Module prefix, purpose and seconds to compile of each group of kernels; the first prefix that matches counts."""

_LONGEST_WAIT = 120.0  # [s] for another process to compile a kernel


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
        options: dict[str, Any] = {"error_model": "numpy" if divides_by_zero else "python"}
        if not allocates:
            options["pipeline_class"] = loop_compiler(is_wide=is_wide)
        dispatcher = _njit(no_cfunc_wrapper=True, nogil=nogil, _nrt=allocates, **options)(plain)
        if isinstance(dispatcher, _CPUDispatcher):  # a plain function under NUMBA_DISABLE_JIT
            dispatcher.__class__ = Kernel
        return cast(Function, dispatcher)

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
    options: dict[str, Any] = {"_nrt": allocates, "nogil": nogil}
    if forceinline:
        options["forceinline"] = True
    if divides_by_zero:
        options["error_model"] = "numpy"
    if not allocates:
        options["pipeline_class"] = loop_compiler(in_lanes=in_lanes)

    def decorate(plain: Function) -> Function:
        dispatcher = _njit(no_cpython_wrapper=True, no_cfunc_wrapper=True, **options)(plain)
        if isinstance(dispatcher, _CPUDispatcher):
            dispatcher.__class__ = DeviceFunction
        return cast(Function, dispatcher)

    return decorate if function is None else decorate(function)


@dataclass(frozen=True)
class Compilation:
    """A kernel that this process made ready: its name, processor time [s], whether it came from the cache."""

    name: str
    seconds: float
    from_cache: bool
    cache_folder: str | None


compilations: list[Compilation] = []
"""Kernels that this process compiled or read from the cache, in order; kernels inside kernels come first."""


class CompiledFunction(_CPUDispatcher):  # type: ignore[misc]
    """A function that Numba compiles once for each combination of argument types."""

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """Resolve a call from a kernel; constant arguments do not create separate specialisations."""
        plain = {name: _numba_types.unliteral(kind) for name, kind in dict(kws).items()}
        return super().get_call_template(tuple(map(_numba_types.unliteral, args)), plain)


class Kernel(CompiledFunction):
    """A compiled function with a cache on disk.

    Attributes:
        only_entry: See :func:`unchecked`.
    """

    only_entry: Callable[..., Any]

    _is_cache_open = False

    def compile(self, sig: Any) -> Any:
        """Compile for one signature, or read the cache."""
        if not self._is_cache_open:  # late, as the stamp needs functions defined further down in the module
            self._is_cache_open = True
            with suppress(RuntimeError):  # no folder to write to: compile in every process
                self._cache = _KernelCache(self)
        _load_array_functions()
        begin, known, hits = time.process_time(), len(self.overloads), sum(self._cache_hits.values())
        try:
            with _paused_collector():
                entry = super().compile(sig)
        finally:
            if isinstance(self._cache, _KernelCache):
                self._cache.unlock()
        if len(self.overloads) > known:
            entries = [result.entry_point for result in self.overloads.values()]
            self.only_entry = entries[0] if len(entries) == 1 else self
            from_cache = sum(self._cache_hits.values()) > hits
            name = f"{self.py_func.__module__}.{self.py_func.__qualname__}"
            seconds = time.process_time() - begin
            compilations.append(Compilation(name, seconds, from_cache, self._cache.cache_path))
        return entry


def unchecked(function: Function) -> Function:
    """The machine code of a kernel for the only types it was called with, which takes those of arguments for granted.

    A call of it takes a third of the time with many arrays. Before the first call, and with several types, it is the
    function itself.
    """
    return getattr(function, "only_entry", function)


def _load_array_functions() -> None:
    """Import Numba's array functions without SciPy, where neither is imported yet.

    They import ``scipy.linalg`` if they find it, which takes 0.3 s, to have another ``np.cov`` and ``np.corrcoef``.
    """
    blas = "scipy.linalg.cython_blas"
    if _ARRAY_FUNCTIONS not in sys.modules and blas not in sys.modules:
        sys.modules[blas] = cast(ModuleType, None)  # not found by an import
        try:
            importlib.import_module(_ARRAY_FUNCTIONS)
        finally:
            del sys.modules[blas]


_ARRAY_FUNCTIONS = "numba.np.arraymath"


@contextmanager
def _paused_collector() -> Iterator[None]:
    """Pause Python's garbage collector, which takes a tenth of the time of compiling: Numba allocates many objects."""
    is_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if is_enabled:
            gc.enable()


class DeviceFunction(CompiledFunction):
    """A compiled function without an entry for Python."""

    def __call__(self, *_args: object, **_keywords: object) -> NoReturn:
        """Refuse: without an entry, a call would end the interpreter."""
        name = self.py_func.__qualname__
        raise TypeError(f"{name}() is a device function, which only kernels call; from Python use {name}.py_func(...)")

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


class _CacheFile(_IndexDataCacheFile):  # type: ignore[misc]
    """Numba's index of compiled signatures; empty if it names a class that was renamed or moved since."""

    def _load_index(self) -> Any:
        try:
            return super()._load_index()
        except (AttributeError, ImportError):
            return {}


class _KernelCache(_FunctionCache):  # type: ignore[misc]
    """Numba's cache of one kernel, valid while the code it was compiled from is unchanged."""

    def __init__(self, dispatcher: Kernel) -> None:
        super().__init__(dispatcher.py_func)
        stamp = hashlib.sha256(repr(list(_ingredients(dispatcher, set()))).encode()).hexdigest()
        self._cache_file = _CacheFile(self.cache_path, self._impl.filename_base, stamp)
        self._module, self._allocates = dispatcher.py_func.__module__, dispatcher.targetoptions["_nrt"]
        self._lock: int | None = None

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        found = self._load(sig, target_context)
        if found is not None:
            return found
        _announce(self._module)
        self._lock = _locked(self.cache_path)
        return self._load(sig, target_context)  # another process may have compiled it in the meantime

    def _load(self, sig: Any, target_context: Any) -> Any:
        # ``super().load_overload`` would import what only compilation needs: 0.1 s and 30 MB in every process.
        if self._allocates:
            _runtime.rtsys.initialize(target_context)
        with self._guard_against_spurious_io_errors():
            found = self._load_overload(sig, target_context)
        # Two processes that add signatures of one kernel concurrently can swap their files.
        return found if found is not None and found.signature.args == tuple(sig) else None

    def unlock(self) -> None:
        """Let other processes compile."""
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None


def _ingredients(dispatcher: CompiledFunction, seen: set[int]) -> Iterator[object]:
    """The code of a compiled function, of those it calls, and the constants they read."""
    function = dispatcher.py_func
    seen.add(id(function))
    yield function.__qualname__, sorted(dispatcher.targetoptions.items()), function.__defaults__
    names: set[str] = set()
    for code in _code_objects(function.__code__):
        yield code.co_code, [value for value in code.co_consts if not isinstance(value, CodeType)], code.co_names
        names.update(code.co_names)
    cells = dict(zip(function.__code__.co_freevars, function.__closure__ or (), strict=True))
    values = {name: function.__globals__[name] for name in sorted(names) if name in function.__globals__}
    values |= {name: cell.cell_contents for name, cell in sorted(cells.items())}
    for name, value in values.items():
        if isinstance(value, _CPUDispatcher):
            if id(value.py_func) not in seen:
                yield from _ingredients(value, seen)
        elif isinstance(value, ModuleType) and value.__name__.startswith(_PACKAGES):
            yield name, [(other, repr(getattr(value, other))) for other in sorted(names) if hasattr(value, other)]
        elif isinstance(value, EnumMeta):
            yield name, [(member.name, member.value) for member in cast(Any, value)]
        elif isinstance(value, type):
            yield name, getattr(value, "_fields", None)
        elif isinstance(value, (bool, int, float, str, tuple)):
            yield name, value
        elif hasattr(value, "tobytes"):
            yield name, str(value.dtype), value.shape, hashlib.sha256(value.tobytes()).hexdigest()
        elif isinstance(value, FunctionType):
            yield name, value.__code__.co_code


def _code_objects(code: CodeType) -> Iterator[CodeType]:
    """A code object and the code objects of comprehensions and functions inside it."""
    yield code
    for value in code.co_consts:
        if isinstance(value, CodeType):
            yield from _code_objects(value)


def _locked(folder: str) -> int | None:
    """Wait until no other process compiles into a cache folder; the lock, or None where folders cannot be locked."""
    if sys.platform == "win32":
        return None
    lock = None
    with suppress(OSError):
        lock = os.open(folder, os.O_RDONLY)
        for _ in range(int(_LONGEST_WAIT / 0.1)):
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                return lock
            except BlockingIOError:
                time.sleep(0.1)
    if lock is not None:
        os.close(lock)
    return None


_announced: set[str] = set()
_is_silent = False


@contextmanager
def silent() -> Iterator[None]:
    """Compile without announcing it, for callers that report their own progress."""
    global _is_silent
    before, _is_silent = _is_silent, True
    try:
        yield
    finally:
        _is_silent = before


def _announce(module: str) -> None:
    """Announce once per process and group that compilation takes a while, on standard error of a terminal or notebook.

    Of several worker processes, only the first does.
    """
    group = next((group for group in _GROUPS if module.startswith(group[0])), None)
    if group is None:
        return
    _, purpose, seconds = group
    is_seen = sys.stderr is not None and (sys.stderr.isatty() or "ipykernel" in sys.modules)
    is_first = parent_process() is None or current_process().name.endswith("-1")
    if seconds >= _ANNOUNCED_FROM and purpose not in _announced and is_seen and is_first and not _is_silent:
        _announced.add(purpose)
        sys.stderr.write(f"Compiling loops for {purpose}, once per installation (about {seconds} s)\n")
        sys.stderr.flush()
