"""Read untrusted pickles: rebuild arrays and builtins, refuse every other name.

A pickle is a program; it may call the functions in the table below only, and nothing is imported. Of NumPy's
constructors the table has only the one for empty arrays: the others trust their input, up to arrays of Python objects
over arbitrary bytes. Covers protocols 0 to 5 and the names of NumPy 1 and 2.
"""

from __future__ import annotations

import collections
import pickle
import re
from pathlib import Path
from typing import Any

import numpy as np

from scenarionet_data.errors import InvalidScenario

_UNREADABLE = "expected a readable pickle, found bytes that are damaged or of another format ({}); copy it again"
_CODES = re.compile(r"[?biufcSUO]\d*")


class _DType:
    """``numpy.dtype`` for numbers, text and objects; custom fields and flags are refused."""

    def __init__(self, code: str, *_: Any) -> None:
        if not _CODES.fullmatch(code):
            raise pickle.UnpicklingError(f"expected an array of numbers, text or objects, found {code!r}")
        self.numpy = np.dtype(code)

    def __setstate__(self, state: tuple[Any, ...]) -> None:
        """Take NumPy's state: version, byte order, sub-array, names, fields, ..."""
        if any(part is not None for part in state[2:5]):
            raise pickle.UnpicklingError("expected an array of numbers, text or objects, found fields")
        self.numpy = self.numpy.newbyteorder(state[1])


_fill = np.ndarray.__setstate__


class _Array(np.ndarray[Any, Any]):
    """``numpy.ndarray`` filled from its state only."""

    def __new__(cls, *_: Any) -> _Array:
        return super().__new__(cls, (0,), np.int8)

    def __setstate__(self, state: tuple[Any, ...]) -> None:
        """Take NumPy's state: version, shape, dtype, order, data; NumPy checks that data match the shape."""
        version, shape, dtype, is_fortran, data = state
        _fill(self, (version, shape, dtype.numpy, is_fortran, data))


def _scalar(dtype: _DType, data: bytes) -> Any:
    return np.frombuffer(data, dtype.numpy)[0]


def _frombuffer(data: bytes, dtype: _DType, shape: tuple[int, ...], order: str) -> np.ndarray[Any, Any]:
    return np.frombuffer(data, dtype.numpy).reshape(shape, order="F" if order == "F" else "C")


def _encode(text: str, encoding: str) -> bytes:
    """``_codecs.encode`` as used by protocols 0 to 2 for bytes."""
    if encoding != "latin1":
        raise pickle.UnpicklingError(f"expected the encoding latin1, found {encoding}")
    return text.encode("latin1")


# NumPy's constructor of an empty array.
_reconstruct: Any = np.zeros(0).__reduce__()[0]
_KINDS = (int, float, bool, str, bytes, bytearray, list, tuple, dict, set, frozenset)
_ALLOWED: dict[tuple[str, str], Any] = {
    ("numpy", "ndarray"): _Array,
    ("numpy", "dtype"): _DType,
    **{(f"numpy.{core}.multiarray", "_reconstruct"): _reconstruct for core in ("core", "_core")},
    **{(f"numpy.{core}.multiarray", "scalar"): _scalar for core in ("core", "_core")},
    **{(f"numpy.{core}.numeric", "_frombuffer"): _frombuffer for core in ("core", "_core")},
    **{("builtins", kind.__name__): kind for kind in _KINDS},
    ("builtins", "long"): int,  # protocols 0 to 2 use the names of Python 2
    ("collections", "defaultdict"): collections.defaultdict,
    ("collections", "OrderedDict"): collections.OrderedDict,
    ("_codecs", "encode"): _encode,
    # MetaDrive's dict subclass, in databases pickled without converting it first.
    ("metadrive.scenario.scenario_description", "ScenarioDescription"): dict,
}


class _Unpickler(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> Any:
        """Look up a name in the table."""
        module = "builtins" if module == "__builtin__" else module
        if (module, name) not in _ALLOWED:
            raise pickle.UnpicklingError(f"expected arrays and builtins, found {module}.{name}")
        return _ALLOWED[module, name]


def load(path: Path, name: str) -> dict[str, Any]:
    """Read the dictionary in a pickle.

    Args:
        path: The file.
        name: Its name in errors.

    Raises:
        InvalidScenario: Damaged, not a dictionary, or attempts to run code.
    """
    try:
        with path.open("rb") as file:
            content = _Unpickler(file).load()
    except OSError as error:
        raise InvalidScenario(name, "pickle", f"cannot be read ({error.strerror or error}); repair the file") from error
    # Damaged bytes are executed as instructions and can raise anything.
    except Exception as error:
        reason = str(error) if str(error).startswith("expected ") else _UNREADABLE.format(type(error).__name__)
        raise InvalidScenario(name, "pickle", reason) from error
    if not isinstance(content, dict):
        raise InvalidScenario(name, "pickle", f"expected a dictionary, found {type(content).__name__}")
    return content
