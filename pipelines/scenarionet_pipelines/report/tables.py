"""Tables of a report."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

from scenarionet_pipelines.messages import count
from scenarionet_pipelines.report.markup import Markup, joined, tag

if TYPE_CHECKING:
    from scenarionet_data.operations.comparison import DatabaseStatistics, Measure
    from scenarionet_data.quality.scorecard import PartitionScore, Scorecard
    from scenarionet_pipelines.report.contents import DatabaseSection


_LEAST = 0.001


def number(value: float | None) -> str:
    """Format a number; a dash if it is missing.

    Example:
        >>> number(12345), number(0.123456), number(float("nan"))
        ('12,345', '0.123', '-')
    """
    if value is None or not math.isfinite(value):
        return "-"
    if float(value).is_integer():
        return f"{value:,.0f}"
    if abs(value) < _LEAST:
        return f"< {_LEAST}"
    return f"{value:,.1f}" if abs(value) >= 100 else f"{value:.3g}"


def table(head: Iterable[str], rows: Iterable[Iterable[Markup]], label: str) -> Markup:
    """Build a table that scrolls sideways if it is wider than the page.

    Args:
        head: Column headers; a header ending in ``#`` marks a numeric column.
        rows: Cells as elements.
        label: Description for screen readers.
    """
    heads = (tag("th", name.rstrip("#"), scope="col", class_="number" if name.endswith("#") else None) for name in head)
    body = tag("tbody", *(tag("tr", *row) for row in rows))
    whole = tag("table", tag("thead", tag("tr", *heads)), body, aria_label=label)
    return tag("div", whole, class_="scroll", tabindex=0, role="region", aria_label=label)


def summary(rows: Sequence[dict[str, Any]]) -> Markup:
    """Table of datasets, versions and splits."""
    numbers = {
        "scenarios": "scenarios", "hours": "hours", "total_objects": "objects",
        "mean_ego_distance": "ego distance [m], mean", "mean_vehicles": "vehicles, mean",
    }  # fmt: skip
    cells = []
    for row in rows:
        names = _row_head(row["dataset"]), tag("td", row["version"]), tag("td", row["split"])
        cells.append((*names, *(_number(row[name]) for name in numbers)))
    head = ("dataset", "version", "split", *(f"{title}#" for title in numbers.values()))
    return table(head, cells, "Content of the lake")


def comparison(statistics: Sequence[DatabaseStatistics]) -> Markup:
    """Table that compares measures of databases."""
    full = next(each.measures for each in statistics if each.measures)
    if len(statistics) == 1:  # one column per statistic
        rows = []
        for measure in full:
            cells = [_number(value) for value in (measure.mean, measure.std, measure.min, measure.max)]
            cells = [_ratio(measure.mean), *[tag("td")] * 3] if measure.unit == "ratio" else cells
            rows.append((_measure_head(measure), *cells, _number(measure.scenarios)))
        head = ("measure", "mean#", "standard deviation#", "smallest#", "largest#", "scenarios#")
        return table(head, rows, f"Measures of {statistics[0].name}")
    counts = (_row_head("scenarios"), *(_number(each.count) for each in statistics))
    rows = [
        (_measure_head(measure), *(_measured(each.measures[place : place + 1]) for each in statistics))
        for place, measure in enumerate(full)
    ]
    return table(("measure", *(f"{each.name}#" for each in statistics)), (counts, *rows), "Comparison")


def _ratio(value: float | None) -> Markup:
    return tag("td", "-" if value is None else f"{value:.1%}", class_="number")


def _measure_head(measure: Measure) -> Markup:
    unit = tag("span", f" [{measure.unit}]", class_="unit") if measure.unit not in ("", "ratio") else None
    return tag("th", measure.measure, unit, scope="row")


def _measured(measures: tuple[Measure, ...]) -> Markup:
    if not measures or measures[0].mean is None:
        return tag("td", "-", class_="number")
    (measure,) = measures
    if measure.unit == "ratio":
        return _ratio(measure.mean)
    spread = f" ± {number(measure.std)}" if measure.std is not None else ""
    between = tag("small", f"{number(measure.min)} to {number(measure.max)}")
    return tag("td", number(measure.mean) + spread, between, class_="number")


def missing(sections: Sequence[DatabaseSection]) -> Markup | None:
    """Table of columns with missing values; None if no value is missing."""
    names = dict.fromkeys(name for section in sections for name in section.missing)
    if not names:
        return None
    rows = []
    for name in names:
        counts = [(section.missing.get(name, 0), section.statistics.count) for section in sections]
        words = [f"{number(n)} ({n / of:.1%})" if 0 < n < of else "all" if n else "none" for n, of in counts]
        rows.append((_row_head(name), *(tag("td", text, class_="number") for text in words)))
    return table(("column", *(f"{section.name}#" for section in sections)), rows, "Missing values")


def scorecard(card: Scorecard) -> Markup:
    """Violations of the quality rules by split."""
    others = (tag("p", tag("strong", check), ": ", detail) for check, detail in card.others)
    return joined(*map(_partition, card.partitions), *others)


def _partition(partition: PartitionScore) -> Markup:
    name = "/".join((partition.dataset, partition.version, partition.split))
    text = f"{count(partition.scenarios, 'scenario')}, {partition.quarantined:,} in quarantine"
    published = f"; {partition.coverage.text}" if partition.coverage else ""
    broken = [mark for mark in partition.rules if mark.broken]
    held = [mark.check for mark in partition.rules if not mark.broken]
    rows = []
    for mark in broken:
        word = "ok" if mark.is_met else "failed" if mark.is_hard else "doubtful"
        verdict = tag("td", "within budget" if mark.is_met else word, class_=word)
        share = tag("td", f"{mark.share:.2%}", class_="number")
        example = tag("td", ": ".join(mark.examples[0]) if mark.examples else "", class_="wide")
        rows.append((_row_head(mark.check), verdict, _number(mark.broken), share, example))
    rules = table(("rule", "", "violations#", "share#", "for example"), rows, f"Rules violated in {name}")
    passed = tag("summary", f"{count(len(held), 'rule')} without violations"), tag("p", ", ".join(held))
    note = tag("p", f"{text}{published}.", class_="note")
    return joined(tag("h3", name), note, rules if broken else None, tag("details", *passed) if held else None)


def _row_head(name: str) -> Markup:
    return tag("th", name, scope="row")


def _number(value: float | None) -> Markup:
    return tag("td", number(value), class_="number")
