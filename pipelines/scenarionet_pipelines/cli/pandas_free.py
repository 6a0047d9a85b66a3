"""Arrow without pandas, which it imports to recognise its objects, in 0.2 to 0.5 s of processor time."""

from __future__ import annotations

import importlib
import sys
from importlib.abc import MetaPathFinder


class WithoutPandas(MetaPathFinder):
    """Imports do not find pandas."""

    def find_spec(self, fullname: str, *_: object) -> None:
        """Find nothing; raise for pandas."""
        if fullname == "pandas":
            raise ModuleNotFoundError(fullname)


def leave_pandas_out() -> None:
    """Let Arrow look for pandas while there is none to be found.

    Later imports find it, but Arrow's ``to_pandas`` does not: not for verbs that run code of others.
    """
    finder = WithoutPandas()
    sys.meta_path.insert(0, finder)
    try:
        importlib.import_module("pyarrow").array([])
    finally:
        sys.meta_path.remove(finder)
