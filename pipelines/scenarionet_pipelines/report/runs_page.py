"""A page that compares runs: tables of all metrics, and pictures of the scenarios that got worst."""

from __future__ import annotations

from pathlib import Path

from scenarionet_data import Lake
from scenarionet_data.plots import Scene, draw_scenario, new_figure
from scenarionet_data.plots.style import as_png
from scenarionet_data.storage.files.places import local_path
from scenarionet_pipelines.report.changes import change_text, mean_text
from scenarionet_pipelines.report.markup import Markup, joined, picture, tag
from scenarionet_pipelines.report.page import page
from scenarionet_pipelines.report.tables import table
from scenarionet_sim.evaluation.comparison import RunComparison
from scenarionet_sim.render.rollouts import rollout_moments

_MAX_PICTURES = 12
_PANEL = (4.0, 2.8)  # inches
_DPI = 100


def write(comparison: RunComparison, lake: Lake, path: str | Path) -> None:
    """Write the page.

    Args:
        comparison: What it shows.
        lake: The lake with the runs, for pictures of their rollouts.
        path: The HTML file.
    """
    file = local_path(path, "a comparison")
    file.write_text(render(comparison, lake), "utf-8")


def render(comparison: RunComparison, lake: Lake) -> str:
    """Return the page as HTML."""
    title = f"{comparison.runs[-1]} compared with {comparison.runs[0]}"
    counts = f"{len(comparison.better)} scenarios got better and {len(comparison.worse)} worse, by "
    judged = tag("p", counts, tag("code", comparison.judged_by), ".")
    notes = joined(*(tag("p", f"Note: {note}.") for note in comparison.notes))
    heads = ["metric", *comparison.runs, *(f"change to {run}" for run in comparison.runs[1:])]
    rows: dict[str, list[list[Markup]]] = {}
    for metric in comparison.metrics:
        cells = [*map(mean_text, metric.means, metric.scenarios), *map(change_text, metric.changes[1:])]
        row = [tag("th", metric.metric, scope="row"), *(tag("td", text) for text in cells)]
        rows.setdefault("All scenarios" if metric.group == "all" else metric.group, []).append(row)
    tables = (tag("section", tag("h2", group), table(heads, each, group)) for group, each in rows.items())
    return page(
        title,
        tag("header", tag("h1", title), judged, notes),
        tag("main", *tables, _worst(comparison, lake)),
    )


def _worst(comparison: RunComparison, lake: Lake) -> Markup | None:
    runs, figures = (comparison.runs[0], comparison.runs[-1]), []
    for scenario_id, change in comparison.worse[:_MAX_PICTURES]:
        words = f"Scenario {scenario_id}: {runs[0]} on the left, {runs[1]} on the right"
        image = picture(_picture(lake, runs, scenario_id), words)
        figures.append(tag("figure", image, tag("figcaption", scenario_id, tag("span", f"{change:+.4g}"))))
    return tag("section", tag("h2", "Got worst"), tag("div", *figures, class_="pictures pairs")) if figures else None


def _picture(lake: Lake, runs: tuple[str, str], scenario_id: str) -> bytes:
    """PNG file of what both runs did until the last one's first crash, or its end; the recording without rollouts."""
    scene = Scene.of(lake.loader([scenario_id])[0])
    facts = {row["run"]: row for row in lake.sql(_FACTS, {"runs": list(runs), "scenario_id": scenario_id}).to_dicts()}
    crash = facts[runs[1]]["first_collision"]
    figure = new_figure(2.0 * _PANEL[0], _PANEL[1], dpi=_DPI)
    panels, view = figure.subplots(1, 2), "route" if crash is None else "ego"
    figure.subplots_adjust(left=0.01, right=0.99, top=0.9, bottom=0.01, wspace=0.02)
    for axes, run in zip(panels, runs, strict=True):
        moments = rollout_moments(lake, run, scene) if facts[run]["has_rollout"] else None
        if moments is not None and crash is not None:
            moments = moments[: round(crash / scene.dt) + 1]
        draw_scenario(axes, scene, moments=moments, view=view, ratio=_PANEL[0] / _PANEL[1], has_legend=False)
        axes.set_title(run if moments is not None else f"{run}: the recording, without trajectories", fontsize=8)
    return as_png(figure)


_FACTS = """
    SELECT run, min(first_collision) AS first_collision, any_value(seen.run IS NOT NULL) AS has_rollout
    FROM results
    LEFT JOIN (SELECT DISTINCT run, scenario_id FROM rollouts WHERE rollout = 0) AS seen USING (run, scenario_id)
    WHERE list_contains($runs, run) AND scenario_id = $scenario_id AND rollout = 0
    GROUP BY run
"""
