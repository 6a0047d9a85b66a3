"""Plots of scenarios, databases and lakes in one style, for notebooks, web pages, papers and the simulator.

    from matplotlib.figure import Figure
    from scenarionet_data import plots

    plots.draw_scenario(axes, scenario, timestep=20)       # draws into your axes
    plots.scenario_figure(scenario, color_by="speed")      # returns a figure
    plots.thumbnail(scenario, (240, 180))                  # returns a small PNG file
    plots.Drawing(view="ego").save("drive.mp4", scenario)  # .png .pdf .svg .gif .mp4
    plots.animate(scenario)                                # a video in a notebook
    plots.small_multiples(scenarios)                       # many scenarios in a grid
    plots.draw_profiles(scenario, ["t1", "t7"])            # speed, acceleration, curvature
    plots.draw_distributions(lake)                         # histograms of columns of metadata
    plots.draw_comparison(lake.compare("busy", "calm"))    # means and standard deviations

Colours and sizes are defined in :mod:`scenarionet_data.plots.palette`, which has no dependencies. Drawing requires
matplotlib (extra ``plots``), mp4 videos require PyAV (extra ``video``). No display is needed, and the global state of
matplotlib is not changed.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from scenarionet_data.errors import MissingDependency

if TYPE_CHECKING:
    from scenarionet_data.plots.animation import Animation, animate
    from scenarionet_data.plots.comparison import draw_comparison, write_comparison
    from scenarionet_data.plots.distributions import Distribution, draw_distributions
    from scenarionet_data.plots.drawing import Drawing, draw_scenario, scenario_figure, small_multiples
    from scenarionet_data.plots.files import write_figure, write_video
    from scenarionet_data.plots.profiles import draw_profiles
    from scenarionet_data.plots.scene import Moment, Scene, Window
    from scenarionet_data.plots.style import new_figure, styled
    from scenarionet_data.plots.thumbnails import thumbnail
    from scenarionet_data.plots.topdown import TopDown

__all__ = [
    "Animation",
    "Distribution",
    "Drawing",
    "Moment",
    "Scene",
    "TopDown",
    "Window",
    "animate",
    "draw_comparison",
    "draw_distributions",
    "draw_profiles",
    "draw_scenario",
    "new_figure",
    "scenario_figure",
    "small_multiples",
    "styled",
    "thumbnail",
    "write_comparison",
    "write_figure",
    "write_video",
]

_HOME = {
    "Animation": "animation",
    "Distribution": "distributions",
    "Drawing": "drawing",
    "Moment": "scene",
    "Scene": "scene",
    "TopDown": "topdown",
    "Window": "scene",
    "animate": "animation",
    "draw_comparison": "comparison",
    "draw_distributions": "distributions",
    "draw_profiles": "profiles",
    "draw_scenario": "drawing",
    "new_figure": "style",
    "scenario_figure": "drawing",
    "small_multiples": "drawing",
    "styled": "style",
    "thumbnail": "thumbnails",
    "write_comparison": "comparison",
    "write_figure": "files",
    "write_video": "files",
}


def __getattr__(name: str) -> Any:
    """Import on first use."""
    if name not in _HOME:
        raise AttributeError(f"scenarionet_data.plots has no {name!r}; it has {', '.join(__all__)}")
    try:
        return getattr(importlib.import_module(f"{__name__}.{_HOME[name]}"), name)
    except ModuleNotFoundError as error:
        if (error.name or "").split(".")[0] not in ("matplotlib", "PIL"):
            raise
        raise MissingDependency("pictures need matplotlib", "plots") from error
