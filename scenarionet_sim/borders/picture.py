"""A picture of where a policy fails: a map for each pair of parameters."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from scenarionet_data.plots.files import write_figure
from scenarionet_data.plots.style import new_figure, plain, styled
from scenarionet_sim.borders.lattice import MIXED
from scenarionet_sim.borders.search import FAILS, IMPOSSIBLE, SearchReport

_INCHES = 4.2  # of a map


def draw_map(found: SearchReport) -> Figure:
    """Draw the share that fails over each pair of parameters: mean of all others, a mixed cell as a half.

    With one parameter the map has one row. Grey is where nothing can be.
    """
    pairs = list(combinations(range(len(found.axes)), 2)) or [(0, 0)]
    fails = (found.regions == FAILS) + 0.5 * (found.regions == MIXED)
    possible = found.regions != IMPOSSIBLE
    with styled():
        figure = new_figure(_INCHES * len(pairs) + 0.8, _INCHES, layout="constrained")
        every = figure.subplots(1, len(pairs), squeeze=False)[0]
        for axes, (x, y) in zip(every, pairs, strict=True):
            rest = tuple(axis for axis in range(len(found.axes)) if axis not in (x, y))
            count = possible.sum(axis=rest)
            share = np.where(count > 0, (fails * possible).sum(axis=rest) / np.maximum(count, 1), np.nan)
            across = np.asarray(found.edges[y]) if x != y else np.array([0.0, 1.0])
            axes.set_facecolor("0.6")
            drawn = axes.pcolormesh(
                np.asarray(found.edges[x]), across, np.atleast_2d(share.T), vmin=0.0, vmax=1.0, cmap="RdYlGn_r"
            )
            axes.set_xlabel(plain(found.axes[x], 40))
            axes.set_ylabel(plain(found.axes[y], 40) if x != y else "")
        figure.colorbar(drawn, ax=list(every), label="share that fails")
    return figure


def save_map(found: SearchReport, path: Path | str) -> None:
    """Write the picture as png, pdf or svg.

    Raises:
        BadParameter: The suffix is another one.
    """
    write_figure(path, draw_map(found))
