"""Statistics of databases as a picture: a panel a measure, a bar a database, with the standard deviation."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from scenarionet_data.catalog.comparison import Statistics
from scenarionet_data.errors import BadParameter, MissingDependency

SUFFIXES = (".png", ".svg", ".pdf")
_COLUMNS = 4


def draw(statistics: Sequence[Statistics], path: str | Path) -> None:
    """Write the picture.

    Args:
        statistics: Of at least one database with scenarios, see :func:`comparison.compare`.
        path: A file that ends in one of SUFFIXES.

    Raises:
        BadParameter: Another ending, or there are no scenarios.
        MissingDependency: Matplotlib is not installed.
    """
    if Path(path).suffix not in SUFFIXES:
        raise BadParameter(f"{path}: wanted a file name that ends in {', '.join(SUFFIXES)}")
    shown = [each for each in statistics if each.measures]
    if not shown:
        raise BadParameter("no scenarios to draw; name a database that has some")
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingDependency("pictures need matplotlib: pip install 'scenarionet-lake[plots]'") from error
    num_rows = -(-len(shown[0].measures) // _COLUMNS)
    figure = Figure(figsize=(3.2 * _COLUMNS, 0.9 + (0.9 + 0.25 * len(shown)) * num_rows), layout="constrained")
    panels = figure.subplots(num_rows, _COLUMNS, squeeze=False).flat
    names = [f"{each.name} ({each.count:,})" for each in shown]
    colors = [f"C{number % 10}" for number in range(len(shown))]
    for place, panel in enumerate(panels):
        if place >= len(shown[0].measures):
            panel.set_visible(False)
            continue
        measures = [each.measures[place] for each in shown]
        panel.barh(
            names,
            [measure.mean or 0.0 for measure in measures],
            xerr=[measure.std or 0.0 for measure in measures],
            color=colors,
            ecolor="0.3",
            capsize=2,
        )
        unit = measures[0].unit
        panel.set_title(f"{measures[0].measure} [{unit}]" if unit not in ("", "ratio") else measures[0].measure)
        panel.set_xlim(left=0, right=1 if unit == "ratio" else None)
        panel.invert_yaxis()
        if place % _COLUMNS:
            panel.set_yticklabels([])
    figure.savefig(path, dpi=150)
