"""Style of all figures, set per figure without changing matplotlib's global state or needing a display."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Literal

from cycler import cycler
from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from scenarionet_data.plots.palette import INK, SERIES

FigureLayout = Literal["constrained", "compressed", "tight"]

_STYLE: dict[str, Any] = {
    "axes.axisbelow": True,
    "axes.edgecolor": "#9aa1a8",
    "axes.grid": True,
    "axes.labelcolor": INK,
    "axes.prop_cycle": cycler(color=SERIES),
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlelocation": "left",
    "axes.titlesize": 10,
    "axes.titleweight": "bold",
    "font.size": 9,
    "grid.color": "#e3e6e9",
    "grid.linewidth": 0.6,
    "legend.edgecolor": "none",
    "legend.fontsize": 8,
    "legend.framealpha": 0.9,
    "text.color": INK,
    "xtick.color": "#555b61",
    "ytick.color": "#555b61",
}


@contextmanager
def styled() -> Iterator[None]:
    """Apply the style to axes and texts created inside the block."""
    with rc_context(_STYLE):  # type: ignore[arg-type]
        yield


class NotebookFigure(Figure):
    """A figure that notebooks display without matplotlib integration."""

    def _repr_png_(self) -> bytes:
        return as_png(self)


def as_png(figure: Figure, dpi: float | Literal["figure"] = "figure") -> bytes:
    """Return a figure as a PNG file, with its own or other pixels per inch."""
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=dpi)
    return file.getvalue()


def new_figure(
    width: float, height: float, *, dpi: float = 100.0, facecolor: str | None = None, layout: FigureLayout | None = None
) -> Figure:
    """Create a figure that belongs to no window and that notebooks display.

    Args:
        width, height: Size [inch].
        dpi: Pixels per inch.
        facecolor: Background colour.
        layout: Layout engine of matplotlib.
    """
    figure = NotebookFigure(figsize=(width, height), dpi=dpi, facecolor=facecolor, layout=layout)
    FigureCanvasAgg(figure)
    return figure


def plain(words: str, longest: int) -> str:
    """Return a text for a figure: without math markup and line breaks, shortened in the middle if too long."""
    line = " ".join(words.split()).replace("$", r"\$")
    half = (longest - 1) // 2
    return line if len(line) <= longest else f"{line[:half]}…{line[-half:]}"
