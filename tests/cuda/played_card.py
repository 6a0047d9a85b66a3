"""A graphics card played by the processor: its threads one after another, compiled by Numba, its memory NumPy's."""

from __future__ import annotations

from types import SimpleNamespace
from uuid import uuid4
from weakref import proxy

import numpy as np

from scenarionet_sim.cameras.cuda import drawing, frames, memory
from tests.cuda import emulation


class CardArray(np.ndarray):
    """An array with the methods of those on a card."""

    def copy_to_host(self):
        return np.array(self)

    def copy_to_device(self, values):
        self[...] = values


class Device:
    """A card, which contexts of numba-cuda know by a weak reference, which has no hash."""

    def __init__(self):
        self.uuid = f"GPU-{uuid4()}"


class PlayedCard:
    """Replaces numba-cuda in the modules of cameras.

    Args:
        monkeypatch: Pytest's.

    Attributes:
        launches: Kernel and arguments of each launch so far.
        uploads: Numbers of bytes that were uploaded for good.
    """

    def __init__(self, monkeypatch):
        self.launches: list[tuple[str, tuple[object, ...]]] = []
        self.uploads: list[int] = []
        self.device = Device()
        context = SimpleNamespace(device=proxy(self.device))  # without a hash itself, too
        cuda = SimpleNamespace(
            device_array=lambda shape, dtype: np.empty(shape, dtype).view(CardArray),
            to_device=self._upload,
            current_context=lambda: context,
            synchronize=lambda: None,
        )
        for module in (drawing, memory, frames):
            monkeypatch.setattr(module, "cuda", cuda)
        monkeypatch.setattr(drawing, "kernels", emulation.KERNELS)
        monkeypatch.setattr(drawing, "launch", self._launch)

    def _upload(self, values):
        self.uploads.append(values.nbytes)
        return np.array(values).view(CardArray)

    def _launch(self, kernel, count, *arguments):
        if count:
            plain = tuple(_plain(each) for each in (count, *arguments))
            self.launches.append((kernel.py_func.__name__, plain))
            kernel(*plain)


def _plain(value):
    """The same with NumPy's own arrays."""
    if isinstance(value, np.ndarray):
        return value.view(np.ndarray)
    if hasattr(value, "_fields"):
        return type(value)(*map(_plain, value))
    return tuple(map(_plain, value)) if isinstance(value, tuple) else value
