"""Reads a pickle that may come from anyone: arrays and builtins are rebuilt, every other name is refused.

A pickle is a program; what it may call is the table below and nothing else. Covers protocols 0 to 5 and the names
of numpy 1 and 2.
"""

from __future__ import annotations

import collections
import pickle
from pathlib import Path
from typing import Any

import numpy as np

from scenarionet_data.errors import InvalidScenario


def _encode_latin1(text: str, encoding: str) -> bytes:
    """``_codecs.encode`` as protocols 0 to 2 need it, to write bytes as text."""
    if encoding != "latin1":
        raise pickle.UnpicklingError(f"wanted the encoding latin1, found {encoding}")
    return text.encode("latin1")


# What numpy calls to rebuild an array, a scalar, and an array of protocol 5.
_rebuild_array: Any = np.zeros(0).__reduce__()[0]
_rebuild_scalar: Any = np.float64(0).__reduce__()[0]
_rebuild_buffer: Any = np.zeros(1).__reduce_ex__(5)[0]

_NUMPY = {
    **{(f"numpy.{core}.multiarray", "_reconstruct"): _rebuild_array for core in ("core", "_core")},
    **{(f"numpy.{core}.multiarray", "scalar"): _rebuild_scalar for core in ("core", "_core")},
    **{(f"numpy.{core}.numeric", "_frombuffer"): _rebuild_buffer for core in ("core", "_core")},
    ("numpy", "ndarray"): np.ndarray,
    ("numpy", "dtype"): np.dtype,
}
_BUILTINS = {
    **{("builtins", kind.__name__): kind for kind in (int, float, bool, str, bytes, bytearray)},
    **{("builtins", kind.__name__): kind for kind in (list, tuple, dict, set, frozenset)},
    ("builtins", "long"): int,  # protocols 0 to 2 call builtins as Python 2 did
    ("collections", "defaultdict"): collections.defaultdict,
    ("collections", "OrderedDict"): collections.OrderedDict,
    ("_codecs", "encode"): _encode_latin1,
    # MetaDrive's dict with methods, in databases that were pickled without converting it first.
    ("metadrive.scenario.scenario_description", "ScenarioDescription"): dict,
}
_ALLOWED: dict[tuple[str, str], Any] = _NUMPY | _BUILTINS


class _Unpickler(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> Any:
        """Look a name up in the table; nothing is ever imported."""
        module = "builtins" if module == "__builtin__" else module
        if (module, name) not in _ALLOWED:
            raise pickle.UnpicklingError(f"wanted arrays and builtins, found {module}.{name}")
        return _ALLOWED[module, name]


def load(path: Path, name: str) -> dict[str, Any]:
    """The dictionary in a pickle.

    Args:
        path: The file.
        name: What to call it in an error.

    Raises:
        InvalidScenario: It is damaged, holds something else, or wants to run code.
    """
    try:
        with path.open("rb") as file:
            content = _Unpickler(file).load()
    # Damaged bytes are instructions too: they can raise anything.
    except Exception as error:
        raise InvalidScenario(name, "pickle", f"wanted a readable pickle, found {error or type(error)}") from error
    if not isinstance(content, dict):
        raise InvalidScenario(name, "pickle", f"wanted a dictionary, found {type(content).__name__}")
    return content
