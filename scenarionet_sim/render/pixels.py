"""A picture in a figure of matplotlib, pixel by pixel."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.artist import Artist

from scenarionet_data.arrays.dtypes import UInt8


class Pixels(Artist):
    """Shows a picture without scaling it, which takes matplotlib's own images longer than a scene takes to draw."""

    def __init__(self) -> None:
        super().__init__()
        self._content: UInt8 = np.zeros((1, 1, 4), np.uint8)

    def set_picture(self, picture: UInt8) -> None:
        """Show (H, W, 3) uint8 from now on."""
        opaque = np.full((*picture.shape[:2], 1), 255, np.uint8)
        self._content = np.concatenate([picture[::-1], opaque], axis=2)
        self.stale = True

    def draw(self, renderer: Any) -> None:
        """Copy the picture to the lower left corner of the figure."""
        renderer.draw_image(renderer.new_gc(), 0.0, 0.0, self._content)
