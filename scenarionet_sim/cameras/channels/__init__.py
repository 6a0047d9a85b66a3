"""Channels of pictures: a module each, with the number and the type of values per pixel and a device function.

To add one, write its module and name it in ``_NAMES``; ``rgb`` alone is drawn by ``draw.frames``.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy as np

from scenarionet_data.compiled.decorators import device_function
from scenarionet_sim.cameras.draw.structures import FrameView, Pictures, SceneArrays, Tile, Triangles

_NAMES = "depth", "semantic", "instance", "normals", "flow"
_MODULES = [import_module(f"{__name__}.{name}") for name in _NAMES]

CHANNELS: dict[str, tuple[int, type[np.generic]]] = {
    "rgb": (3, np.uint8),
    **{name: (module.VALUES, module.DTYPE) for name, module in zip(_NAMES, _MODULES, strict=True)},
}
"""Channels: numbers per pixel and their type."""


def shape_of_channel(name: str, num_pixels: int) -> tuple[int, ...]:
    """Return the shape of a channel of a frame, see ``Pictures``."""
    return (3 * num_pixels,) if name == "rgb" else (num_pixels, *tail_of_channel(name))


def tail_of_channel(name: str) -> tuple[int, ...]:
    """Return the shape of a channel at a pixel."""
    return () if CHANNELS[name][0] == 1 else (CHANNELS[name][0],)


def _also(number: int, write: Callable[..., None], others: Callable[..., None]) -> Any:
    """Return a device function that writes a channel, where wanted, after others."""

    @device_function(forceinline=True, divides_by_zero=True)
    def write_channels(
        frame: int,
        first: int,
        view: FrameView,
        scene: SceneArrays,
        triangles: Triangles,
        tile: Tile,
        pictures: Pictures,
    ) -> None:
        others(frame, first, view, scene, triangles, tile, pictures)
        if len(pictures[number]):
            write(first, view, scene, triangles, tile, pictures[number][frame, first : first + len(tile.seen)])

    return write_channels


@device_function(forceinline=True)
def _nothing(
    frame: int, first: int, view: FrameView, scene: SceneArrays, triangles: Triangles, tile: Tile, pictures: Pictures
) -> None:
    """Write nothing."""


write_channels: Callable[[int, int, FrameView, SceneArrays, Triangles, Tile, Pictures], None] = _nothing
"""Write all channels but ``rgb`` that are wanted, of a tile from pixel ``first`` of frame ``frame`` on."""
for _number, _module in enumerate(_MODULES, start=1):
    write_channels = _also(_number, _module.write, write_channels)
