"""Capsules of DLPack, by which libraries share arrays (https://dmlc.github.io/dlpack/latest)."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np

CPU, CUDA = 1, 2
"""Kinds of device: ``DLDeviceType``."""

NO_STREAM, LEGACY_STREAM = -1, 1
"""Streams of a consumer: it synchronizes itself; the default stream, in which kernels run."""

_CODES = {"i": 0, "u": 1, "f": 2}
_NAME = b"dltensor"


class _Tensor(ctypes.Structure):
    """``DLTensor``."""

    _fields_ = (
        ("data", ctypes.c_void_p),
        ("device_type", ctypes.c_int32),
        ("device_id", ctypes.c_int32),
        ("ndim", ctypes.c_int32),
        ("code", ctypes.c_uint8),
        ("bits", ctypes.c_uint8),
        ("lanes", ctypes.c_uint16),
        ("shape", ctypes.POINTER(ctypes.c_int64)),
        ("strides", ctypes.POINTER(ctypes.c_int64)),
        ("byte_offset", ctypes.c_uint64),
    )


class _ManagedTensor(ctypes.Structure):
    """``DLManagedTensor``."""

    _fields_ = (("tensor", _Tensor), ("manager", ctypes.c_void_p), ("deleter", ctypes.c_void_p))


_Deleter = ctypes.CFUNCTYPE(None, ctypes.c_void_p)
_Destructor = ctypes.CFUNCTYPE(None, ctypes.c_void_p)

_alive: dict[int, tuple[object, ...]] = {}
"""What must live until a consumer is done, by the address of its structure."""


@_Deleter
def _delete(address: int) -> None:
    _alive.pop(address, None)


@_Destructor
def _destroy(capsule: int) -> None:
    """Free a capsule that no consumer took; one that did renames it and calls the deleter itself."""
    api = ctypes.pythonapi
    if api.PyCapsule_IsValid(ctypes.c_void_p(capsule), _NAME):
        api.PyCapsule_GetPointer.restype = ctypes.c_void_p
        _delete(api.PyCapsule_GetPointer(ctypes.c_void_p(capsule), _NAME))


def capsule_of(
    owner: object, address: int, shape: tuple[int, ...], dtype: np.dtype[Any], device: tuple[int, int]
) -> object:
    """Return the capsule of a contiguous array.

    Args:
        owner: Owner of the memory, which lives at least as long as the consumer's array.
        address: Of the first value.
        shape, dtype: Of the array; numbers of 8 to 64 bits.
        device: Kind and number.
    """
    sizes = (ctypes.c_int64 * len(shape))(*shape)
    managed = _ManagedTensor(
        _Tensor(
            address, *device, len(shape), _CODES[dtype.kind], 8 * dtype.itemsize, 1,
            ctypes.cast(sizes, ctypes.POINTER(ctypes.c_int64)), None, 0,
        ),
        None,
        ctypes.cast(_delete, ctypes.c_void_p),
    )  # fmt: skip
    place = ctypes.addressof(managed)
    _alive[place] = owner, sizes, managed
    create = ctypes.pythonapi.PyCapsule_New
    create.restype, create.argtypes = ctypes.py_object, [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p]
    return create(place, _NAME, ctypes.cast(_destroy, ctypes.c_void_p))
