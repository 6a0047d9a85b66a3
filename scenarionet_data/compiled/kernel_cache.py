"""The machine code of kernels on disk, valid while the code and the constants that it was compiled from are unchanged.

It derives from the cache inside of Numba, and is used with the versions of ``TESTED``.
"""

from __future__ import annotations

import os
import sys
import time
from contextlib import suppress
from typing import Any

from numba.core import caching, runtime

from scenarionet_data.compiled import bare, shipped
from scenarionet_data.compiled.announcing import announce
from scenarionet_data.compiled.stamps import stamp_of

if sys.platform != "win32":
    import fcntl

_FunctionCache: Any = caching.FunctionCache
_IndexDataCacheFile: Any = caching.IndexDataCacheFile
_runtime: Any = runtime

_LONGEST_WAIT = 120.0  # [s] for another process to compile a kernel


class _CacheFile(_IndexDataCacheFile):  # type: ignore[misc]
    """Numba's index of compiled signatures; empty if it names a class that was renamed or moved since."""

    def _load_index(self) -> Any:
        try:
            return super()._load_index()
        except (AttributeError, ImportError):
            return {}


class KernelCache(_FunctionCache):  # type: ignore[misc]
    """Numba's cache of one kernel, valid while the code it was compiled from is unchanged."""

    def __init__(self, dispatcher: Any) -> None:
        super().__init__(dispatcher.py_func)
        stamp = self._stamp = stamp_of(dispatcher)
        self._cache_file = _CacheFile(self.cache_path, self._impl.filename_base, stamp)
        self._level, package = shipped.level(), dispatcher.py_func.__module__.rpartition(".")[0]
        if self._level is not None:
            self._shipped = _CacheFile(str(self._level.folder / package), self._impl.filename_base, stamp)
        self._module, self._allocates = dispatcher.py_func.__module__, dispatcher.targetoptions["_nrt"]
        self._lock: int | None = None

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the machine code for one signature; None if this process is to compile it."""
        found = self._load(sig, target_context)
        if found is not None:
            return found
        announce(self._module)
        self._lock = _locked(self.cache_path)
        return self._load(sig, target_context)  # another process may have compiled it in the meantime

    def _load(self, sig: Any, target_context: Any) -> Any:
        # ``super().load_overload`` would import what only compilation needs: 0.1 s and 30 MB in every process.
        if self._allocates:
            _runtime.rtsys.initialize(target_context)
        key = self._index_key(sig, target_context.codegen())
        with self._guard_against_spurious_io_errors():
            data = self._cache_file.load(key)
            if data is None and self._level is not None:
                signature, (triple, *_), code = key
                data = self._shipped.load((signature, (triple, self._level.cpu, self._level.features), code))
            found = None if data is None else self._impl.rebuild(target_context, data)
        # Two processes that add signatures of one kernel concurrently can swap their files.
        return found if found is not None and found.signature.args == tuple(sig) else None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Write the machine code for one signature, also for processes without Numba."""
        super().save_overload(sig, data)
        with self._guard_against_spurious_io_errors():
            bare.write(self.cache_path, self._py_func, self._stamp, data)

    def unlock(self) -> None:
        """Let other processes compile."""
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None


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
