"""Bar charts that compare statistics of databases, one panel per measure."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure

from scenarionet_data.errors import BadParameter
from scenarionet_data.operations.comparison import DatabaseStatistics
from scenarionet_data.plots.files import PICTURES, write_figure
from scenarionet_data.plots.palette import SERIES
from scenarionet_data.plots.style import new_figure, plain, styled

_COLUMNS = 4


def write_comparison(statistics: Sequence[DatabaseStatistics], path: str | Path) -> None:
    """Write a comparison chart to a file.

    Args:
        statistics: Result of ``Lake.compare`` with at least one scenario.
        path: A .png, .pdf or .svg file.

    Raises:
        BadParameter: The suffix is not supported, or there are no scenarios.
    """
    if Path(path).suffix not in PICTURES:
        raise BadParameter(f"{path}: wanted a file name that ends in {', '.join(PICTURES)}")
    write_figure(path, draw_comparison(statistics))


def draw_comparison(statistics: Sequence[DatabaseStatistics]) -> Figure:
    """Draw means and standard deviations of databases; measures without values are left out.

    Args:
        statistics: Result of ``Lake.compare`` with at least one scenario.

    Raises:
        BadParameter: There are no scenarios.
    """
    if not isinstance(statistics, Sequence):
        raise BadParameter(f"statistics: expected the result of lake.compare, found {statistics!r}")
    shown = [each for each in statistics if each.measures]
    if not shown:
        raise BadParameter("no scenarios to draw; name a database that has some")
    num_rows = -(-len(shown[0].measures) // _COLUMNS)
    names = [f"{plain(each.name, 24)} ({each.count:,})" for each in shown]
    colors = [SERIES[number % len(SERIES)] for number in range(len(shown))]
    with styled():
        figure = new_figure(3.2 * _COLUMNS, 0.9 + (0.9 + 0.25 * len(shown)) * num_rows, layout="constrained")
        panels = figure.subplots(num_rows, _COLUMNS, squeeze=False).flat
        for place, panel in enumerate(panels):
            if place >= len(shown[0].measures):
                panel.set_visible(False)
                continue
            measures = [each.measures[place] for each in shown]
            unit = measures[0].unit
            panel.barh(
                names,
                [measure.mean or 0.0 for measure in measures],
                xerr=None if unit == "ratio" else [measure.std or 0.0 for measure in measures],
                color=colors,
                ecolor="0.3",
                capsize=2,
            )
            panel.set_title(f"{measures[0].measure} [{unit}]" if unit not in ("", "ratio") else measures[0].measure)
            panel.set_xlim(left=0, right=1 if unit == "ratio" or not any(measure.max for measure in measures) else None)
            panel.invert_yaxis()
            panel.grid(visible=False, axis="y")
            if place % _COLUMNS:
                panel.set_yticklabels([])
    return figure
