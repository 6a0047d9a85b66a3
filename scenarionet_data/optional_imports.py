"""Modules whose import takes longer than what most commands do: hidden from Arrow and Numba, or put off."""

from __future__ import annotations

import importlib
import importlib.util
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any

import pyarrow as pa


class _Hiding:
    """A finder of modules that raises for modules in the thread that made it."""

    def __init__(self, names: tuple[str, ...]) -> None:
        self._names, self._thread = names, threading.get_ident()

    def find_spec(self, fullname: str, *_: object) -> None:
        if fullname in self._names and threading.get_ident() == self._thread:
            raise ModuleNotFoundError(f"{fullname} is hidden here", name=fullname)


@contextmanager
def hidden(*names: str) -> Iterator[None]:
    """Let imports of modules that are not imported yet fail in this thread, as if they were not installed."""
    finder = _Hiding(names)
    sys.meta_path.insert(0, finder)
    try:
        yield
    finally:
        sys.meta_path.remove(finder)


class _TellingArrow:
    """A finder of modules that lets Arrow know of pandas as soon as anybody imports it."""

    def find_spec(self, fullname: str, *_: object) -> ModuleSpec | None:
        if fullname != "pandas":
            return None
        sys.meta_path.remove(self)
        spec = importlib.util.find_spec(fullname)
        if spec is not None:
            loader: Any = spec.loader
            execute = loader.exec_module

            def execute_and_tell(module: ModuleType) -> None:
                execute(module)
                with suppress(ImportError):  # too old for Arrow, which then works without
                    pa.nulls(0).to_pandas()

            loader.exec_module = execute_and_tell
        return spec


def leave_pandas_out() -> None:
    """Keep Arrow from importing pandas, in 0.2 to 0.5 s of processor time, to recognise its objects.

    There are none before somebody imports pandas: then Arrow gets to know it, and works with it as always.
    """
    if "pandas" not in sys.modules:
        with hidden("pandas"):
            pa.array([])  # Arrow looks for pandas once
        sys.meta_path.insert(0, _TellingArrow())


class _Deferred(ModuleType):
    """A module that is imported when somebody uses one of its names."""

    _lock = threading.Lock()

    def __getattr__(self, name: str) -> Any:
        if name == "__path__":  # it is no package
            raise AttributeError(name)
        with self._lock:
            if sys.modules.get(self.__name__) is self:
                del sys.modules[self.__name__]
        module = importlib.import_module(self.__name__)
        vars(self).update(vars(module))
        return getattr(module, name)


def defer(name: str) -> None:
    """Put off the import of a submodule until one of its names is used; do nothing if it is imported already."""
    if name not in sys.modules:
        parent, _, child = name.rpartition(".")
        module = _Deferred(name)
        module.__spec__ = importlib.util.find_spec(name)
        sys.modules[name] = module
        setattr(sys.modules[parent], child, module)
