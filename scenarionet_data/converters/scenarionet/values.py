"""Values of pickles as JSON and back: arrays, tuples, sets, keys that are not text, numbers that are not finite.

What JSON has is written as it is; everything else as ``{"!": kind, ...}``. NumPy's scalars become Python's numbers, and
subclasses of dict other than defaultdict(int) become dict.
"""

from __future__ import annotations

import base64
import math
from collections import defaultdict
from collections.abc import Callable
from typing import Any

import numpy as np

_KIND = "!"
_COLLECTIONS: dict[str, Callable[[list[Any]], Any]] = {"tuple": tuple, "set": set, "frozenset": frozenset}


def to_plain(value: Any) -> Any:
    """Return a value that JSON represents.

    Raises:
        TypeError: Neither a builtin nor an array.
    """
    if value is None or type(value) in (str, int, bool):
        return value
    if isinstance(value, np.generic):
        return to_plain(value.item())
    if isinstance(value, float):
        return value if math.isfinite(value) else {_KIND: "float", "value": str(value)}
    if isinstance(value, list):
        return [to_plain(item) for item in value]
    if isinstance(value, dict):
        counts = isinstance(value, defaultdict) and value.default_factory is int
        if not counts and all(type(key) is str for key in value) and _KIND not in value:
            return {key: to_plain(item) for key, item in value.items()}
        items = [[to_plain(key), to_plain(item)] for key, item in value.items()]
        return {_KIND: "mapping", "counts": counts, "items": items}
    if isinstance(value, tuple):
        return {_KIND: "tuple", "items": [to_plain(item) for item in value]}
    if isinstance(value, set | frozenset):
        return {_KIND: type(value).__name__, "items": [to_plain(item) for item in sorted(value, key=repr)]}
    if isinstance(value, np.ndarray):
        plain = {_KIND: "array", "dtype": value.dtype.str, "shape": list(value.shape)}
        if value.dtype.kind in "OUS":
            return plain | {"items": to_plain(value.reshape(-1).tolist())}
        data = value.tobytes()
        first = data[: value.itemsize]
        if value.size > 1 and data == first * value.size:  # such as controls that are 0 throughout
            data = first
        return plain | {"data": base64.b64encode(data).decode()}
    if isinstance(value, bytes | bytearray):
        return {_KIND: "bytes", "data": base64.b64encode(value).decode()}
    raise TypeError(f"expected builtins and arrays, found {type(value).__name__}")


def from_plain(value: Any) -> Any:
    """Return a new copy of the value that :func:`to_plain` represents."""
    if isinstance(value, list):
        return [from_plain(item) for item in value]
    if not isinstance(value, dict):
        return value
    kind = value.get(_KIND)
    if kind is None:
        return {key: from_plain(item) for key, item in value.items()}
    if kind == "float":
        return float(value["value"])
    if kind == "bytes":
        return base64.b64decode(value["data"])
    if kind == "array":
        dtype, shape = np.dtype(value["dtype"]), tuple(value["shape"])
        if "items" in value:
            values = np.empty(len(value["items"]), dtype)
            values[:] = from_plain(value["items"])
            return values.reshape(shape)
        values = np.frombuffer(base64.b64decode(value["data"]), dtype)
        size = math.prod(shape)
        return np.array(np.broadcast_to(values, (size,)) if len(values) == 1 else values).reshape(shape)
    if kind == "mapping":
        items = [(from_plain(key), from_plain(item)) for key, item in value["items"]]
        return defaultdict(int, items) if value["counts"] else dict(items)
    return _COLLECTIONS[kind]([from_plain(item) for item in value["items"]])
