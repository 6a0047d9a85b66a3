"""Arrays in the memory of a graphics card that other libraries take without a copy."""

from __future__ import annotations

from typing import Any

import numba.cuda
import numpy as np

from scenarionet_data.arrays.dtypes import Array
from scenarionet_sim.cameras.cuda.dlpack import CPU, CUDA, LEGACY_STREAM, NO_STREAM, capsule_of

cuda: Any = numba.cuda


class DeviceFrames:
    """Frames of one channel in the memory of a graphics card.

    ``torch.from_dlpack(frames)`` is a tensor over the same memory, and so is the array of every library that knows
    DLPack or the CUDA array interface.

    Args:
        array: Contiguous array of numba-cuda.

    Attributes:
        array: The same.
    """

    def __init__(self, array: Any) -> None:
        self.array = array

    @property
    def shape(self) -> tuple[int, ...]:
        """(B, H, W) or (B, H, W, values)."""
        return tuple(self.array.shape)

    @property
    def dtype(self) -> np.dtype[Any]:
        """Type of the values."""
        dtype: np.dtype[Any] = self.array.dtype
        return dtype

    @property
    def __cuda_array_interface__(self) -> dict[str, Any]:
        interface: dict[str, Any] = self.array.__cuda_array_interface__
        return interface

    def __dlpack_device__(self) -> tuple[int, int]:
        """Return kind and number of the device; numba's simulator has its arrays in the memory of the host."""
        if hasattr(self.array, "__cuda_array_interface__"):
            return CUDA, int(cuda.get_current_device().id)
        return CPU, 0

    def __dlpack__(
        self,
        *,
        stream: int | None = None,
        max_version: tuple[int, int] | None = None,
        dl_device: tuple[int, int] | None = None,
        copy: bool | None = None,
    ) -> object:
        """Return the capsule of the array, as the Python array API describes it.

        Args:
            stream: Of the consumer; other streams than the one that draws wait until frames are drawn.
            max_version: Any: the capsule is of the first version.
            dl_device: This device, or None.
            copy: False or None.

        Raises:
            BufferError: Another device or a copy is asked for.
        """
        del max_version
        if copy or dl_device not in (None, self.__dlpack_device__()):
            raise BufferError("frames are handed on without a copy on their device; copy_to_host() returns an array")
        if stream not in (NO_STREAM, LEGACY_STREAM):
            cuda.synchronize()
        on_card = getattr(self.array, "__cuda_array_interface__", None)
        address = (on_card or self.array.__array_interface__)["data"][0]
        return capsule_of(self.array, address, self.shape, self.dtype, self.__dlpack_device__())

    def copy_to_host(self) -> Array:
        """Return a copy as a NumPy array."""
        copied: Array = self.array.copy_to_host()
        return copied
