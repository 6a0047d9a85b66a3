"""Stamps of compiled functions: two with the same stamp have the same machine code."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from enum import EnumMeta
from types import CodeType, FunctionType, ModuleType
from typing import Any, cast

_PACKAGES = ("scenarionet_data", "scenarionet_sim")


def stamp_of(function: Any) -> str:
    """Stamp of a function: of its code, of those it calls, and of the constants that they read."""
    return hashlib.sha256(repr(list(_ingredients(function, set()))).encode()).hexdigest()


def _ingredients(dispatcher: Any, seen: set[int]) -> Iterator[object]:
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
        if hasattr(value, "targetoptions"):
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
