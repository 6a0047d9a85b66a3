"""Aliases for NumPy array types, by dtype; shapes, units and frames are given where an array is documented."""

from __future__ import annotations

from numbers import Real
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

Array: TypeAlias = npt.NDArray[Any]
Bool: TypeAlias = npt.NDArray[np.bool_]
Float32: TypeAlias = npt.NDArray[np.float32]
Float64: TypeAlias = npt.NDArray[np.float64]
Int8: TypeAlias = npt.NDArray[np.int8]
Int16: TypeAlias = npt.NDArray[np.int16]
Int32: TypeAlias = npt.NDArray[np.int32]
Int64: TypeAlias = npt.NDArray[np.int64]
IntP: TypeAlias = npt.NDArray[np.intp]
UInt8: TypeAlias = npt.NDArray[np.uint8]
UInt32: TypeAlias = npt.NDArray[np.uint32]
UInt64: TypeAlias = npt.NDArray[np.uint64]
Complex128: TypeAlias = npt.NDArray[np.complex128]
Object: TypeAlias = npt.NDArray[np.object_]
ArrayRecord: TypeAlias = Any
"""One element of a record array: ``np.record``, whose fields NumPy does not type."""
RecordArray: TypeAlias = Any
"""``np.recarray``: fields are attributes, each an array."""


def is_number(value: object) -> bool:
    """Return whether a value is a real number, of Python or NumPy, and no truth value."""
    return isinstance(value, Real) and not isinstance(value, bool)


def is_count(value: object, least: int | None = 0) -> bool:
    """Return whether a value is a whole number, of Python or NumPy, that is not below ``least``."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer):
        return False
    return least is None or int(value) >= least
