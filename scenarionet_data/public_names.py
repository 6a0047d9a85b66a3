"""Names that are imported on first use: those of users, as ``module:Class``, and public names of a package.

A package lists its names as imports under ``if TYPE_CHECKING``, one ``from module import Name as Name`` a line.
"""

from __future__ import annotations

import ast
import gc
import importlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from scenarionet_data.errors import BadParameter


def import_on_first_use(package: str, file: str) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """Return ``__getattr__``, ``__dir__`` and ``__all__`` of a package.

    Args:
        package: Name of the package.
        file: Path of its ``__init__.py``.
    """
    statements = ast.parse(Path(file).read_text("utf-8")).body
    (block,) = (node for node in statements if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING")
    imports = [node for node in block.body if isinstance(node, ast.ImportFrom) and node.module]
    home_of = {alias.asname: str(node.module) for node in imports for alias in node.names if alias.asname}
    names = sorted(home_of)

    def import_name(name: str) -> Any:
        if name not in home_of:
            raise AttributeError(f"{package} has no {name!r}; it has {', '.join(names)}")
        with paused_collector():
            if home_of[name] == package:
                return importlib.import_module(f"{package}.{name}")
            return getattr(importlib.import_module(home_of[name]), name)

    return import_name, lambda: names, names


@contextmanager
def paused_collector() -> Iterator[None]:
    """Pause Python's garbage collector, which takes a tenth of the time of imports and of Numba's compiler.

    Both make many objects, and hardly any garbage. So does a converter of one raw record, which may consist of 100,000
    small objects that would be scanned again and again.
    """
    is_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if is_enabled:
            gc.enable()


def load_by_name(reference: str) -> Any:
    """Return what ``module:Class`` names.

    Raises:
        BadParameter: The module cannot be imported, or has no such name.
    """
    module, _, name = reference.partition(":")
    try:
        return getattr(importlib.import_module(module), name)
    except (ImportError, AttributeError) as error:
        raise BadParameter(f"{reference}: {error}; is its folder on PYTHONPATH?") from error
    except Exception as error:  # whatever the module does
        raise BadParameter(f"{reference}: its module raised {type(error).__name__}: {error}") from error
