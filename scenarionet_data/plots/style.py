"""One style for every figure, set figure by figure: nothing global is touched, and no display is needed."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from cycler import cycler
from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from scenarionet_data.plots.palette import INK, SERIES

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
    """Axes and texts made inside have the style."""
    with rc_context(_STYLE):  # type: ignore[arg-type]
        yield


class Picture(Figure):
    """A figure that notebooks show by itself, whether or not they know matplotlib."""

    def _repr_png_(self) -> bytes:
        file = io.BytesIO()
        self.savefig(file, format="png")
        return file.getvalue()


def new_figure(width: float, height: float, *, dpi: float = 100.0, **style: Any) -> Figure:
    """A figure that belongs to no window, and that notebooks show.

    Args:
        width, height: [inch].
        dpi: Pixels an inch.
    """
    figure = Picture(figsize=(width, height), dpi=dpi, **style)
    FigureCanvasAgg(figure)
    return figure


def plain(words: str, longest: int) -> str:
    """Words that a figure shows as they are: no mathematics, no line breaks, the middle left out when too long."""
    line = " ".join(words.split()).replace("$", r"\$")
    half = (longest - 1) // 2
    return line if len(line) <= longest else f"{line[:half]}…{line[-half:]}"
