"""Histograms of columns of metadata by dataset or database, computed in SQL."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from matplotlib.figure import Figure

from scenarionet_data.arrays.dtypes import Float64, is_count
from scenarionet_data.databases.record import DatabaseRecord
from scenarionet_data.errors import BadParameter
from scenarionet_data.plots.palette import SERIES
from scenarionet_data.plots.style import new_figure, plain, styled
from scenarionet_data.query.lake_view import LakeLike, open_view
from scenarionet_data.schema import tables

MEASURES = ("ego_distance", "ego_mean_speed", "ego_cumulative_curvature", "num_objects", "num_map_features", "duration")
"""Columns that are drawn by default."""

_LINES = [(color, style) for style, color in product(("-", "--"), SERIES)]

_LIMITS = """
SELECT quantile_cont(value, 0.005) AS lower, quantile_cont(value, 0.995) AS upper, count(*) AS known
FROM (SELECT "{column}"::DOUBLE AS value FROM metadata) WHERE isfinite(value)
"""

_COUNTS = """
SELECT name, bin, count(*) AS n
FROM (
    SELECT {group} AS name,
        CASE WHEN isfinite(value)
            THEN greatest(0, least($bins - 1, floor((value - $lower) / $step)))::INTEGER
        END AS bin
    FROM (SELECT *, "{column}"::DOUBLE AS value FROM metadata)
)
GROUP BY ALL ORDER BY ALL
"""


@dataclass(frozen=True, eq=False)
class Distribution:
    """Histogram of one column for the scenarios of one group.

    Attributes:
        name: Name of the group.
        edges: (bins + 1,) edges of the bins; the outer bins include outliers, 0.5 % of all values on either side.
        counts: (bins,) number of scenarios in each bin.
        missing: Number of scenarios without a value (null or NaN).
    """

    name: str
    edges: Float64
    counts: Float64
    missing: int


def distributions(
    lake: LakeLike,
    column: str,
    by: str = "dataset",
    databases: Sequence[DatabaseRecord | str] = (),
    bins: int | None = None,
) -> list[Distribution]:
    """Return the distribution of a column of ``metadata`` for each group, with common bins.

    Args:
        lake: The lake.
        column: A numeric or boolean column.
        by: Column whose values define the groups.
        databases: Databases to use as the groups instead.
        bins: Maximum number of bins; depends on the number of scenarios by default. Bins of integers are integers.

    Raises:
        BadParameter: The column does not exist or is not numeric.
    """
    view = open_view(lake)
    there = dict(view.sql("SELECT column_name, column_type FROM (DESCRIBE metadata)").rows())
    for name in (column, by):
        if name not in there:
            raise BadParameter(f"no column {name!r} in metadata; docs/reference/data_dictionary.md lists them")
    if there[column].startswith(("VARCHAR", "JSON")) or there[column].endswith("]"):
        raise BadParameter(f"{column} holds no numbers; name a column of docs/reference/data_dictionary.md that does")
    chosen = [view.record(each) for each in databases]
    parts = [(each.reference, view.restrict_to(each)) for each in chosen] or [("", view)]
    limits = [part.sql(_LIMITS.format(column=column)).row(0) for _, part in parts]
    fewest = min(known for _, _, known in limits)
    table = tables.load("metadata")
    types = {each.name: each.type for each in (*table.columns, *table.derived)}
    edges = _edges(
        limits,
        types.get(column, "").startswith(("int", "uint", "bool")),
        bins or int(np.clip(2 * np.cbrt(fewest), 5, 60)),
    )
    bound = {"bins": len(edges) - 1, "lower": float(edges[0]), "step": (edges.max() - edges.min()) / (len(edges) - 1)}
    found = []
    for reference, part in parts:
        group = "$reference" if reference else f"coalesce(\"{by}\"::VARCHAR, 'none')"
        words = bound | ({"reference": reference} if reference else {})
        rows = part.sql(_COUNTS.format(column=column, group=group), words)
        for name in dict.fromkeys(rows["name"]):
            mine = rows.filter(rows["name"] == name)
            counts, known = np.zeros(len(edges) - 1), mine.drop_nulls("bin")
            counts[known["bin"].to_numpy()] = known["n"].to_numpy()
            found.append(Distribution(name, edges, counts, int(mine.filter(mine["bin"].is_null())["n"].sum())))
    return found


def _edges(limits: Sequence[tuple[float | None, float | None, int]], is_whole: bool, bins: int) -> Float64:
    """Edges of the common bins, between the limits of all groups."""
    lower = min((low for low, _, _ in limits if low is not None), default=0.0)
    upper = max((high for _, high, _ in limits if high is not None), default=1.0)
    if is_whole:
        first, last = math.floor(lower), math.ceil(upper)
        step = math.ceil((last - first + 1) / bins)
        return np.arange(first, last + 1 + step, step, dtype=np.float64) - 0.5
    upper = upper if upper > lower else lower + 1.0
    return np.linspace(float(lower), float(upper), bins + 1)


def draw_distributions(
    lake: LakeLike,
    columns: Sequence[str] = MEASURES,
    *,
    by: str = "dataset",
    databases: Sequence[DatabaseRecord | str] = (),
    bins: int | None = None,
) -> Figure:
    """Draw distributions of columns of ``metadata``, one panel per column and one line per group.

    Args:
        lake: The lake.
        columns: Numeric columns; :data:`MEASURES` by default.
        by: Column whose values define the groups.
        databases: Databases to use as the groups instead.
        bins: Maximum number of bins; depends on the number of scenarios by default.

    Raises:
        BadParameter: There are no scenarios or too many groups, or a column does not exist.
    """
    view = open_view(lake)
    if isinstance(columns, str) or not isinstance(columns, Sequence) or not columns:
        raise BadParameter(f"columns: expected several, such as ['ego_distance'], found {columns!r}")
    if not (bins is None or is_count(bins, 1)):
        raise BadParameter(f"bins: expected a whole number of 1 or more, found {bins!r}")
    if not len(view):
        raise BadParameter(f"{view.root}: no scenarios to draw; `scenarionet convert` puts some there")
    width, num_rows = min(3, len(columns)), -(-len(columns) // 3)
    with styled():
        figure = new_figure(3.2 * width, 2.4 * num_rows + 0.4, layout="constrained")
        panels = list(figure.subplots(num_rows, width, squeeze=False).flat)
        for panel in panels[len(columns) :]:
            panel.set_visible(False)
        for panel, column in zip(panels, columns, strict=False):
            groups = distributions(view, column, by, databases, bins)
            if len(groups) > len(_LINES):
                raise BadParameter(f"{by} has {len(groups)} values, more than lines can be told apart: {len(_LINES)}")
            for group, (color, style) in zip(groups, _LINES, strict=False):
                share = group.counts / max(group.counts.sum(), 1.0) * 100
                panel.stairs(
                    share, group.edges, color=color, linestyle=style, linewidth=1.5, label=plain(group.name, 24)
                )
                panel.stairs(share, group.edges, color=color, fill=True, alpha=0.10)
            missing = sum(group.missing for group in groups)
            panel.set_title(f"{missing:,} missing" if missing else "", fontsize=8, fontweight="normal", loc="right")
            table = tables.load("metadata")
            units = {each.name: each.unit for each in (*table.columns, *table.derived)}
            unit = units.get(column, "")
            panel.set(xlabel=(f"{column} [{unit}]" if unit else column), ylabel="scenarios [%]", ylim=(0, None))
        handles, names = panels[0].get_legend_handles_labels()
        figure.legend(handles, names, loc="outside lower center", ncols=min(len(names), 4))
    return figure
