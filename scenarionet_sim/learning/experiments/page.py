"""The page of an experiment: settings, sources, tables with intervals, curves, and computed verdicts."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from scenarionet_data import Lake
from scenarionet_data.errors import MissingDependency
from scenarionet_sim.learning.config import describe_config
from scenarionet_sim.learning.experiments.comparison import (
    Comparison,
    ComparisonResult,
    curve,
    judge_all,
    read_comparison,
    source_statistics,
    table,
)
from scenarionet_sim.learning.experiments.statistics import CEILING, FLAT

_PROGRESS = ("level", "coverage", "difficulty")
"""Curves of training itself."""

_MOST_POINTS = 12
"""Of a curve in a figure."""


def write_page(lake: Lake, comparison: Comparison, folder: str | Path, commit: str) -> Path:
    """Write the page of a finished experiment, with its figures and Parquet files.

    Args:
        lake: The lake with its runs.
        comparison: The experiment.
        folder: Where to write; created if missing.
        commit: Commit of the configuration, which the page names.

    Returns:
        The page, ``page.md``.

    Raises:
        BadParameter: A run is missing or not complete.
        MissingDependency: matplotlib is not installed.
    """
    found, folder = read_comparison(lake, comparison), Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    found.curves.write_parquet(folder / "curves.parquet")
    found.chosen.write_parquet(folder / "chosen.parquet")
    sources = source_statistics(lake, comparison.sources)
    for source, known in comparison.published_sources.items():
        sources.append({name: known.get(name, "") for name in sources[0]} | {"source": f"the paper: {source}"})
    published = [
        {"driver": each.arm, "figure": each.metric, "in": each.place, "the paper": f"{each.value:.3f}",
         f"here, on the {comparison.tests[each.test]}": str(table(found, comparison, each.test)[each.arm][each.metric])}
        for each in comparison.published
    ]  # fmt: skip
    first, names = comparison.arms[0], [arm.name for arm in comparison.arms]
    settings, steps = describe_config(first.config), sorted({arm.config.steps for arm in comparison.arms})
    same = " and the ".join(comparison.tests[name] for name in comparison.shared)
    sections = [
        f"# {comparison.name} ({comparison.size})",
        f"Configuration of commit `{commit}`, fixed before this run: {'; '.join(names)}; seeds "
        f"{', '.join(map(str, comparison.seeds))}; {' or '.join(f'{count:,}' for count in steps)} steps of agents a "
        "run. The table shows each run at the checkpoint with the highest success on the validation split of its own "
        "training scenarios (the latest of equals). Intervals are 95 % intervals of Student's t over seeds. Each seed "
        "has test scenarios of its own, so that intervals are of seeds and scenarios together"
        f"{f'; not of the {same}, whose scenarios are the same for all seeds' if same else ''}.",
        "`out_of_road` is the share that left the recorded way, `crashed` the share with at least one crash, `cost` "
        "the number of crashes, `speed_ratio` the speed as a share of the recorded one, `distance_to_log` and "
        "`final_distance` the distance [m] from the recorded position, over the episode and at its end.",
        f"Settings of {first.name}: {', '.join(f'{name} {value}' for name, value in settings.items())}.",
        *([f"The paper: {comparison.paper}"] if comparison.paper else []),
        *(["## Scenarios", _markdown(sources)] if sources else []),
        *_verdicts(found, comparison),
        *(["## Earlier runs", _markdown(vars(each) for each in comparison.earlier)] if comparison.earlier else []),
        *(["## Beside the paper's results", _markdown(published)] if published else []),
    ]
    for test, title in comparison.tests.items():
        picture = f"{test}.svg"
        _draw(found, comparison, test, title, folder / picture)
        of_arm = "trained on" if comparison.name == "cross-dataset" else "algorithm"
        rows = _markdown(
            {of_arm: arm} | {name: str(interval) for name, interval in metrics.items()}
            for arm, metrics in table(found, comparison, test).items()
        )
        sections += [f"## {title}", f"![Learning curves on the {title}]({picture})", rows]
    page = folder / "page.md"
    page.write_text("\n\n".join(sections) + "\n", "utf-8")
    return page


def _verdicts(found: ComparisonResult, comparison: Comparison) -> list[str]:
    """Return the claims with their verdicts."""
    rows = []
    for claim, (said, interval, why) in zip(comparison.claims, judge_all(found, comparison.claims), strict=True):
        rows.append({"claim": claim.text, "verdict": f"**{said}**", "paired difference": str(interval), "because": why})
    how = (
        "A claim is supported if the whole interval of the paired difference (same seeds) is above 0, not supported if "
        "it is below, otherwise inconclusive; intervals are as wide as Holm's method asks for so many claims, "
        "so that a wrong verdict on the page has a probability below 5 %. "
        f"It is inconclusive in any case if both arms succeed in {CEILING:.0%} or more, which no test can tell apart, "
        "or if inverse dynamics has an error of 5 % or more of the actions' variance (of all held-out transitions, "
        "also those that a limit cuts), or if a curve, or the loss of a discriminator, has not flattened, that is if "
        f"its mean over the last quarter of the checkpoints differs from the quarter before by more than {FLAT}."
    )
    return ["## Claims of the paper", how, _markdown(rows)]


def _markdown(rows: Iterable[dict[str, Any]]) -> str:
    """Return rows as a table."""
    listed = list(rows)
    lines = [list(listed[0]), ["---"] * len(listed[0])]
    lines += [[f"{value:.3g}" if isinstance(value, float) else str(value) for value in row.values()] for row in listed]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _draw(found: ComparisonResult, comparison: Comparison, test: str, title: str, path: Path) -> None:
    """Draw the mean of every metric over the steps, with the range of the seeds."""
    try:
        from matplotlib import rc_context
        from matplotlib.figure import Figure
    except ModuleNotFoundError as error:
        raise MissingDependency("pictures need matplotlib", "plots") from error
    tested = found.curves.filter(pl.col("test") == test)
    figure = Figure(figsize=(12, 12), layout="constrained")
    places = figure.subplots(4, 4).ravel()
    for place, metric in zip(places, (*comparison.metrics, *_PROGRESS), strict=False):
        rows = found.curves.filter(pl.col("database").is_null()) if metric in _PROGRESS else tested
        for number, arm in enumerate(comparison.arms):
            values = curve(rows, arm.name, metric).astype(np.float64)
            if np.isnan(values).all(axis=0).any():  # no curriculum
                continue
            steps = curve(rows, arm.name, "steps").mean(axis=0)
            kept = np.linspace(0, len(steps) - 1, min(len(steps), _MOST_POINTS)).astype(int)
            steps, values = steps[kept], values[:, kept]
            place.plot(steps, values.mean(axis=0), f"C{number}", label=arm.name)
            place.fill_between(
                steps, np.nanmin(values, axis=0), np.nanmax(values, axis=0), alpha=0.12, facecolor=f"C{number}"
            )
        place.locator_params(axis="x", nbins=4)
        place.set(title=metric.replace("_", " "), xlabel="steps")
    for place in places[len(comparison.metrics) + len(_PROGRESS) :]:
        place.set_axis_off()
    figure.legend(*places[0].get_legend_handles_labels(), loc="outside lower center", ncols=len(comparison.arms))
    figure.suptitle(title)
    with rc_context({"svg.fonttype": "none"}):
        figure.savefig(path)
    path.write_text(re.sub(r"(\.\d)\d+", r"\1", path.read_text("utf-8")), "utf-8")  # tenths of a point are enough
