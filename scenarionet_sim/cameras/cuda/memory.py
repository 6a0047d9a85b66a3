"""Memory of the graphics card: what is uploaded once, what is uploaded at every call, and what is used again."""

from __future__ import annotations

from collections import OrderedDict
from math import prod
from typing import Any
from weakref import WeakKeyDictionary

import numba.cuda
import numpy as np
import numpy.typing as npt

from scenarionet_data.arrays.dtypes import Array
from scenarionet_sim.worlds.blocks import Blocks

cuda: Any = numba.cuda

_KEPT = 32
"""Constant arrays that are kept: textures, meshes, and the rays of lenses."""


class DeviceMemory:
    """Arrays on one graphics card."""

    def __init__(self) -> None:
        self._buffers: dict[str, Any] = {}
        self._constants: OrderedDict[int, tuple[Array, Any]] = OrderedDict()
        self._copies: WeakKeyDictionary[Blocks, dict[str, Any]] = WeakKeyDictionary()
        self._num_put: WeakKeyDictionary[Blocks, int] = WeakKeyDictionary()

    def buffer(self, name: str, shape: tuple[int, ...], dtype: npt.DTypeLike) -> Any:
        """Return an array to write to, in the same memory at every call with a name; its contents are undefined."""
        count = prod(shape)
        if count == 0:
            return cuda.device_array(shape, dtype)
        flat = self._buffers.get(name)
        if flat is None or len(flat) < count:
            flat = self._buffers[name] = cuda.device_array(count, dtype)
        return flat[:count].reshape(shape)

    def put(self, name: str, values: Array) -> Any:
        """Upload an array that differs from call to call, to the same memory for a name."""
        place = self.buffer(name, values.shape, values.dtype)
        if values.size:
            place.copy_to_device(np.ascontiguousarray(values))
        return place

    def constant(self, values: Array) -> Any:
        """Return the copy of an array that never changes, uploaded at the first call."""
        found = self._constants.pop(id(values), None) or (values, cuda.to_device(np.ascontiguousarray(values)))
        self._constants[id(values)] = found  # holds the array, so that its identity stays taken
        while len(self._constants) > _KEPT:
            self._constants.popitem(last=False)
        return found[1]

    def rows(self, blocks: Blocks) -> dict[str, Any]:
        """Return the copies of arrays of blocks by name; blocks stored since the last call are uploaded."""
        copies, num_new = self._copies.get(blocks, {}), blocks.num_put - self._num_put.get(blocks, 0)
        for name, values in blocks.arrays.items():
            if name not in copies or len(copies[name]) != len(values) or num_new > len(blocks.last_put):
                copies[name] = cuda.to_device(values)
                continue
            for start, end in list(blocks.last_put)[len(blocks.last_put) - num_new :]:
                if start < end:
                    copies[name][start:end].copy_to_device(values[start:end])
        self._copies[blocks], self._num_put[blocks] = copies, blocks.num_put
        return copies
