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

from typing import TYPE_CHECKING, Any

from scenarionet_data.errors import MissingDependency
from scenarionet_data.public_names import import_on_first_use

if TYPE_CHECKING:
    from scenarionet_data.plots.animation import Animation as Animation
    from scenarionet_data.plots.animation import animate as animate
    from scenarionet_data.plots.comparison import draw_comparison as draw_comparison
    from scenarionet_data.plots.comparison import write_comparison as write_comparison
    from scenarionet_data.plots.distributions import Distribution as Distribution
    from scenarionet_data.plots.distributions import draw_distributions as draw_distributions
    from scenarionet_data.plots.drawing import Drawing as Drawing
    from scenarionet_data.plots.drawing import draw_scenario as draw_scenario
    from scenarionet_data.plots.drawing import scenario_figure as scenario_figure
    from scenarionet_data.plots.drawing import small_multiples as small_multiples
    from scenarionet_data.plots.files import write_figure as write_figure
    from scenarionet_data.plots.files import write_video as write_video
    from scenarionet_data.plots.profiles import draw_profiles as draw_profiles
    from scenarionet_data.plots.scene import Moment as Moment
    from scenarionet_data.plots.scene import Scene as Scene
    from scenarionet_data.plots.scene import Window as Window
    from scenarionet_data.plots.style import new_figure as new_figure
    from scenarionet_data.plots.style import styled as styled
    from scenarionet_data.plots.thumbnails import thumbnail as thumbnail
    from scenarionet_data.plots.topdown import TopDown as TopDown

_import, __dir__, __all__ = import_on_first_use(__name__, __file__)


def __getattr__(name: str) -> Any:
    try:
        return _import(name)
    except ModuleNotFoundError as error:
        if (error.name or "").split(".")[0] not in ("matplotlib", "PIL"):
            raise
        raise MissingDependency("pictures need matplotlib", "plots") from error
