"""Many scenarios beside each other."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from matplotlib.cm import ScalarMappable
from matplotlib.figure import Figure

from scenarionet_data.errors import BadParameter
from scenarionet_data.plots.drawing import COLORS, color_limit, draw_scenario, style_colors
from scenarionet_data.plots.scene import Scene
from scenarionet_data.plots.style import new_figure, plain, styled
from scenarionet_data.scenario.description import ScenarioDescription


def small_multiples(
    scenarios: Sequence[ScenarioDescription | Scene],
    titles: Sequence[str] | None = None,
    *,
    timesteps: Sequence[int | None] | None = None,
    columns: int = 4,
    side: float = 2.6,
    color_by: str | None = None,
    **options: Any,
) -> Figure:
    """Scenarios in rows, all drawn alike.

    Args:
        scenarios: What is drawn.
        titles: A line above each; the scenario's id unless given.
        timesteps: When, of each; the current timestep unless given.
        columns: In a row.
        side: Of one picture [inch].
        color_by: See :func:`~scenarionet_data.plots.drawing.draw_scenario`; all share one colour bar.
        options: See :func:`~scenarionet_data.plots.drawing.draw_scenario`; no legends, the view ``ego``.

    Raises:
        BadParameter: There is nothing to draw.
    """
    if not scenarios:
        raise BadParameter("no scenarios to draw; an empty selection has no pictures")
    columns = min(columns, len(scenarios))
    num_rows = -(-len(scenarios) // columns)
    options = {"view": "ego", "width": 80.0, "ratio": 1.0, "has_legend": False, **options}
    with styled():
        figure = new_figure(side * columns, (side + 0.25) * num_rows, layout="constrained")
        panels = list(figure.subplots(num_rows, columns, squeeze=False).flat)
        scenes = [Scene.of(scenario) for scenario in scenarios]
        if color_by:
            options["limit"] = max(color_limit(scene, color_by) for scene in scenes)
            colors = ScalarMappable()
            style_colors(colors, options["limit"])
            figure.colorbar(colors, ax=panels, location="bottom", shrink=0.4, aspect=40, label=COLORS[color_by])
        for place, panel in enumerate(panels):
            if place >= len(scenarios):
                panel.set_visible(False)
                continue
            draw_scenario(panel, scenes[place], timesteps[place] if timesteps else None, color_by=color_by, **options)
            words = titles[place] if titles else scenes[place].scenario_id
            panel.set_title(plain(words, 34), fontsize=8)
    return figure
