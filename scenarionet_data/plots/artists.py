"""Matplotlib artists with line widths and marker sizes in metres; many lines are drawn as one path."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.artist import Artist
from matplotlib.backend_bases import RendererBase
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D
from matplotlib.patches import PathPatch
from matplotlib.path import Path

from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.arrays.ragged import Ragged


def points_per_metre(artist: Artist) -> float:
    """Return the length of one metre in an artist's axes [1/72 inch]."""
    figure = artist.get_figure(root=True)
    if artist.axes is None or figure is None:
        raise ValueError("an artist in metres is drawn on axes")
    (left, bottom), (right, top) = artist.axes.transData.transform([(0.0, 0.0), (1.0, 0.0)])
    return float(np.hypot(right - left, top - bottom)) * 72.0 / figure.dpi


class Strokes(PathPatch):
    """Lines of one colour and width, drawn as one path.

    Args:
        lines: K x (n, 2) [m].
        color: Colour.
        metres: Line width [m].
        least: Minimum line width [1/72 inch], because thinner lines would fade.
    """

    def __init__(self, lines: Ragged, color: str, metres: float, least: float = 0.5, **style: Any) -> None:
        super().__init__(compound(lines), fill=False, edgecolor=color, capstyle="butt", **style)
        self._metres, self._least = metres, least

    def draw(self, renderer: RendererBase) -> None:
        """Draw with the line width in data units."""
        self.set_linewidth(max(self._metres * points_per_metre(self), self._least))
        super().draw(renderer)


class Pieces(LineCollection):
    """Lines of many colours and one width.

    Args:
        lines: (K, 2, 2) [m].
        metres: Line width [m].
        least: Minimum line width [1/72 inch].
    """

    def __init__(self, lines: Array, metres: float, least: float = 0.8, **style: Any) -> None:
        super().__init__(list(lines), capstyle="butt", **style)
        self._metres, self._least = metres, least

    def draw(self, renderer: RendererBase) -> None:
        """Draw with the line width in data units."""
        self.set_linewidth(max(self._metres * points_per_metre(self), self._least))
        super().draw(renderer)


class Marks(Line2D):
    """Markers of one colour and shape.

    Args:
        places: (n, 2) [m].
        fill: Fill colour.
        shape: Matplotlib name of the marker.
        edge: Colour of the outline.
        metres: Size [m], clipped to ``least`` and ``most`` [1/72 inch].
    """

    def __init__(
        self,
        places: npt.ArrayLike,
        fill: str,
        shape: str,
        edge: str,
        metres: float = 1.6,
        least: float = 3.5,
        most: float = 9.0,
        **style: Any,
    ) -> None:
        x, y = np.asarray(places, np.float64).reshape(-1, 2).T
        super().__init__(
            x, y, linestyle="", marker=shape, markersize=least, markerfacecolor=fill,
            markeredgecolor=edge, markeredgewidth=0.6, **style,
        )  # fmt: skip
        self._metres, self._least, self._most = metres, least, most

    def draw(self, renderer: RendererBase) -> None:
        """Draw with the marker size in data units."""
        if self.axes is not None:  # markers of a legend have no axes and keep their size
            self.set_markersize(min(max(self._metres * points_per_metre(self), self._least), self._most))
        super().draw(renderer)


def areas(outlines: Ragged, color: str, linewidth: float = 0.0, **style: Any) -> PathPatch:
    """Fill areas with one colour as one path; overlaps stay filled regardless of the orientation of the outlines."""
    return PathPatch(compound(_one_way_round(outlines)), facecolor=color, edgecolor=color, linewidth=linewidth, **style)


def compound(lines: Ragged) -> Path:
    """Join lines (n, 2) into one path."""
    codes = np.full(len(lines.values), Path.LINETO, np.uint8)
    codes[lines.offsets[:-1][lines.lengths > 0]] = Path.MOVETO
    return Path(lines.values.astype(np.float64), codes)


def _one_way_round(outlines: Ragged) -> Ragged:
    """Orient all outlines counter-clockwise, because overlaps of opposite orientation would cancel."""
    filled = outlines.take(np.flatnonzero(outlines.lengths > 2))
    if not len(filled):
        return filled
    points = filled.values.astype(np.float64)
    before = np.roll(points, 1, axis=0)
    before[filled.offsets[:-1]] = points[filled.offsets[1:] - 1]
    doubled = np.add.reduceat(before[:, 0] * points[:, 1] - points[:, 0] * before[:, 1], filled.offsets[:-1])
    place = np.arange(len(points))
    turned = np.repeat(filled.offsets[:-1] + filled.offsets[1:] - 1, filled.lengths) - place
    return Ragged(filled.offsets, points[np.where(np.repeat(doubled < 0, filled.lengths), turned, place)])
