"""Top-down frames of a scene: the map is drawn once in tiles, objects are drawn for every frame."""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from scenarionet_data.arrays.dtypes import UInt8
from scenarionet_data.errors import BadParameter
from scenarionet_data.plots import labels, object_layer
from scenarionet_data.plots.map_layer import map_artists
from scenarionet_data.plots.palette import GROUND
from scenarionet_data.plots.scene import Moment, Scene, Window

TRAIL = 20
"""Number of moments in a trail."""

DPI = 100
TILE = 512
"""Side of a tile [pixel]."""

_MOST_TILES = 64


class TopDown:
    """Draws frames of one scene, scenario's +y up.

    Args:
        scene: The scene to draw.
        window: The visible part of the world; its centre follows the ego if ``follows`` is set.
        size: Length of the longer side of a frame [pixel].
        follows: Follow the ego.

    Example:
        view = TopDown(Scene.of(scenario))
        picture = view.frame([view.scene.moment(0)])  # (H, W, 3) uint8
    """

    def __init__(self, scene: Scene, window: Window | None = None, size: int = 800, *, follows: bool = True) -> None:
        self.scene = Scene.of(scene)
        if not isinstance(window, Window | None):
            raise BadParameter(f"window={window!r}; expected a Window, or None")
        self.window = window or Window(0.0, 0.0, 100.0, 100.0)
        self.follows = follows
        self.scale = size / max(self.window.width, self.window.height)  # pixels per metre
        self._width = 2 * round(self.window.width * self.scale / 2)  # video codecs need even sizes
        self._height = 2 * round(self.window.height * self.scale / 2)
        self._tiles: OrderedDict[tuple[int, int], UInt8] = OrderedDict()
        self._map_axes, self._map_canvas = blank_axes(TILE, TILE)
        for artist in map_artists(scene.map):
            self._map_axes.add_artist(artist)
        self._axes, self._canvas = blank_axes(self._width, self._height)
        self._last = self.window.x, self.window.y

    def frame(self, moments: Sequence[Moment]) -> UInt8:
        """Draw a frame (H, W, 3) uint8.

        Args:
            moments: The current states last, after those shown as trails.
        """
        moment = moments[-1]
        if self.follows and moment.present[self.scene.ego]:
            x, y = moment.position[self.scene.ego].tolist()
            self._last = x, y
        x, y = self._last
        left, bottom = round(x * self.scale - self._width / 2), round(y * self.scale - self._height / 2)
        renderer = self._canvas.get_renderer()  # type: ignore[no-untyped-call]
        buffer = np.asarray(renderer.buffer_rgba())
        top = bottom + self._height
        for column in range(math.floor(left / TILE), math.ceil((left + self._width) / TILE)):
            for row in range(math.floor(bottom / TILE), math.ceil(top / TILE)):
                first_x, end_x = max(left, column * TILE), min(left + self._width, (column + 1) * TILE)
                first_y, end_y = max(bottom, row * TILE), min(top, (row + 1) * TILE)
                rows = slice((row + 1) * TILE - end_y, (row + 1) * TILE - first_y)
                columns = slice(first_x - column * TILE, end_x - column * TILE)
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
                part = self._tiles[key][rows, columns]
                buffer[top - end_y : top - first_y, first_x - left : end_x - left] = part
        self._axes.set_xlim(left / self.scale, (left + self._width) / self.scale)
        self._axes.set_ylim(bottom / self.scale, (bottom + self._height) / self.scale)
        artists = object_layer.moving(self.scene, moments)
        artists += labels.scale_bar(self._axes)
        artists += labels.time(self._axes, moments[-1].timestep * self.scene.dt)
        for artist in artists:
            self._axes.add_artist(artist)
        for artist in sorted(artists, key=lambda artist: artist.get_zorder()):
            artist.draw(renderer)
            artist.remove()
        return buffer[..., :3].copy()


def blank_axes(width: int, height: int) -> tuple[Axes, FigureCanvasAgg]:
    """Axes that fill a picture of the given size [pixel], and its canvas."""
    figure = Figure(figsize=(width / DPI, height / DPI), dpi=DPI, facecolor=GROUND)
    canvas = FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    return axes, canvas
