"""Which part of the world a picture shows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenarionet_data.errors import BadParameter
from scenarionet_data.plots.scene import Scene

MARGIN = 30.0
"""Around what has to be seen [m]."""

_LEAST = 80.0
"""Shortest side of a window around a route [m]."""


@dataclass(frozen=True)
class Window:
    """A rectangle, sides parallel to the axes.

    Attributes:
        x, y: Its middle [m].
        width, height: [m].
    """

    x: float
    y: float
    width: float
    height: float

    def __post_init__(self) -> None:
        if not min(self.width, self.height) > 0:
            raise BadParameter(f"a window is wider and higher than 0 m, found {self.width} x {self.height} m")

    @property
    def corners(self) -> tuple[float, float, float, float]:
        """min_x, max_x, min_y, max_y [m]."""
        half_x, half_y = self.width / 2, self.height / 2
        return self.x - half_x, self.x + half_x, self.y - half_y, self.y + half_y

    def shaped(self, ratio: float) -> Window:
        """The smallest window around this one whose width is so many times its height."""
        return Window(self.x, self.y, max(self.width, ratio * self.height), max(self.height, self.width / ratio))

    @classmethod
    def around(cls, points: npt.ArrayLike) -> Window:
        """The window around points (n, 2) [m] with a margin."""
        where = np.asarray(points, np.float64).reshape(-1, 2)
        lower, upper = where.min(axis=0) - MARGIN, where.max(axis=0) + MARGIN
        width, height = np.maximum(upper - lower, _LEAST)
        x, y = (lower + upper) / 2
        return cls(float(x), float(y), float(width), float(height))

    @classmethod
    def on_route(cls, scene: Scene) -> Window:
        """The window around everything the ego's recording drives."""
        return cls.around(scene.route)

    @classmethod
    def on_everything(cls, scene: Scene) -> Window:
        """The window around everything recorded."""
        return cls.around(scene.position[scene.present])
