"""A world seen from above, frame by frame: the map is drawn once, in tiles, and what moves on top of it each time."""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from scenarionet_sim.render import labels, object_layer
from scenarionet_sim.render.map_layer import draw_map
from scenarionet_sim.render.moment import Moment
from scenarionet_sim.render.palette import GROUND
from scenarionet_sim.render.window import Window
from scenarionet_sim.worlds.world import World

Picture = npt.NDArray[np.uint8]

TRAIL = 20
"""Moments that trails show."""

DPI = 100
TILE = 512
"""Side of a tile [pixel]."""

_MOST_TILES = 64


class TopDown:
    """Draws frames of one world, scenario's +y up.

    Args:
        world: What is drawn.
        window: What the frames show; its middle moves along with the ego where ``follows``.
        size: Length of a frame's longer side [pixel].
        follows: Keep the ego in the middle.

    Example:
        view = TopDown(world)
        picture = view.frame([Moment.simulated(world, simulation.state)])  # (H, W, 3) uint8
    """

    def __init__(self, world: World, window: Window | None = None, size: int = 800, *, follows: bool = True) -> None:
        self.world = world
        self.window = window or Window(0.0, 0.0, 100.0, 100.0)
        self.follows = follows
        self.scale = size / max(self.window.width, self.window.height)  # pixels per metre
        self._width = 2 * round(self.window.width * self.scale / 2)  # videos want even numbers
        self._height = 2 * round(self.window.height * self.scale / 2)
        self._tiles: OrderedDict[tuple[int, int], Picture] = OrderedDict()
        self._map_axes, self._map_canvas = _axes(TILE, TILE)
        draw_map(self._map_axes, world.roads, self.points_per_metre)
        self._axes, self._canvas = _axes(self._width, self._height)
        self._last = self.window.x, self.window.y

    @property
    def points_per_metre(self) -> float:
        """How long a metre is [1/72 inch]."""
        return self.scale * 72.0 / DPI

    def frame(self, moments: Sequence[Moment]) -> Picture:
        """A picture (H, W, 3) uint8.

        Args:
            moments: What is there now, after the moments that trails show.
        """
        left, bottom = self._corner(moments[-1])
        renderer = self._canvas.get_renderer()  # type: ignore[no-untyped-call]
        buffer = np.asarray(renderer.buffer_rgba())
        self._paste_map(buffer, left, bottom)
        self._axes.set_xlim(left / self.scale, (left + self._width) / self.scale)
        self._axes.set_ylim(bottom / self.scale, (bottom + self._height) / self.scale)
        artists = object_layer.moving(self.world, moments, self.points_per_metre)
        artists += labels.scale_bar(self._axes)
        artists += labels.time(self._axes, moments[-1].timestep * self.world.dt)
        for artist in artists:
            self._axes.add_artist(artist)
        for artist in sorted(artists, key=lambda artist: artist.get_zorder()):
            artist.draw(renderer)
            artist.remove()
        return buffer[..., :3].copy()

    def _corner(self, moment: Moment) -> tuple[int, int]:
        """Lower left corner of the frame, in whole pixels from the scenario's origin."""
        if self.follows and moment.present[self.world.ego]:
            x, y = moment.position[self.world.ego].tolist()
            self._last = x, y
        x, y = self._last
        return round(x * self.scale - self._width / 2), round(y * self.scale - self._height / 2)

    def _paste_map(self, buffer: Picture, left: int, bottom: int) -> None:
        """Copy the parts of tiles that lie in the frame whose lower left corner is given, rows from the top."""
        top = bottom + self._height
        for column in range(math.floor(left / TILE), math.ceil((left + self._width) / TILE)):
            for row in range(math.floor(bottom / TILE), math.ceil(top / TILE)):
                first_x, end_x = max(left, column * TILE), min(left + self._width, (column + 1) * TILE)
                first_y, end_y = max(bottom, row * TILE), min(top, (row + 1) * TILE)
                rows = slice((row + 1) * TILE - end_y, (row + 1) * TILE - first_y)
                columns = slice(first_x - column * TILE, end_x - column * TILE)
                part = self._tile(column, row)[rows, columns]
                buffer[top - end_y : top - first_y, first_x - left : end_x - left] = part

    def _tile(self, column: int, row: int) -> Picture:
        """A square of the map (TILE, TILE, 4), the least recently used of many forgotten."""
        key = column, row
        if key not in self._tiles:
            side = TILE / self.scale
            self._map_axes.set_xlim(column * side, (column + 1) * side)
            self._map_axes.set_ylim(row * side, (row + 1) * side)
            self._map_canvas.draw()  # type: ignore[no-untyped-call]
            self._tiles[key] = np.array(self._map_canvas.buffer_rgba())  # type: ignore[no-untyped-call]
            if len(self._tiles) > _MOST_TILES:
                self._tiles.popitem(last=False)
        self._tiles.move_to_end(key)
        return self._tiles[key]


def _axes(width: int, height: int) -> tuple[Axes, FigureCanvasAgg]:
    """Axes that fill a picture of so many pixels, and its canvas."""
    figure = Figure(figsize=(width / DPI, height / DPI), dpi=DPI, facecolor=GROUND)
    canvas = FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    return axes, canvas
