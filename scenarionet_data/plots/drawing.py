"""A scenario drawn from above: into axes of yours, as a figure, or into a file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.figure import Figure

from scenarionet_data.errors import BadParameter
from scenarionet_data.plots import labels, object_layer
from scenarionet_data.plots.files import PICTURES, VIDEOS, write_figure, write_video
from scenarionet_data.plots.map_layer import map_artists
from scenarionet_data.plots.moment import Moment
from scenarionet_data.plots.palette import COLORMAP, GROUND
from scenarionet_data.plots.scene import Scene
from scenarionet_data.plots.style import new_figure
from scenarionet_data.plots.topdown import DPI, TRAIL, TopDown
from scenarionet_data.plots.window import Window
from scenarionet_data.scenario.description import ScenarioDescription

_RATIOS = 0.75, 1.8
"""Width over height of a picture, at least and at most, unless asked for."""

VIEWS = ("route", "ego", "all")
COLORS = {"time": "time [s]", "speed": "speed [m/s]"}


def draw_scenario(
    axes: Axes,
    scenario: ScenarioDescription | Scene,
    timestep: int | None = None,
    *,
    view: str = "route",
    width: float = 100.0,
    ratio: float | None = None,
    color_by: str | None = None,
    limit: float | None = None,
    moments: Sequence[Moment] | None = None,
    has_legend: bool = True,
) -> None:
    """Draw a scenario into axes: map, trails or whole trajectories, boxes with headings, lights, scale, time, legend.

    The axes get metres as data, equal on both axes, and no frame. Nothing but these axes is touched.

    Args:
        axes: Of any figure, in any layout.
        scenario: What is drawn.
        timestep: When; the current timestep for None.
        view: ``route`` shows all of the ego's route, ``ego`` keeps the ego in the middle, ``all`` everything recorded.
        width: What the view ``ego`` sees across [m].
        ratio: Width of what is seen over its height; as the view has it, but no narrow strip, unless given.
        color_by: ``time`` or ``speed`` draws everybody's whole trajectory in these colours, with a colour bar; None
            draws the last two seconds as a fading trail.
        limit: Largest number of the colours, for pictures that share a colour bar; this scenario's unless given.
        moments: What happened up to ``timestep`` if not what was recorded, for example in a simulation.
        has_legend: Say what the colours mean, in these axes.

    Raises:
        BadParameter: No such timestep, view or colour.

    Example:
        figure = matplotlib.figure.Figure()
        draw_scenario(figure.subplots(), scenario, timestep=20, color_by="speed")
    """
    scene = Scene.of(scenario)
    past = _past(scene, timestep) if moments is None else moments
    seen = window(view, scene, past[-1], width)
    left, right, bottom, top = seen.shaped(ratio or _no_strip(seen)).corners
    axes.set(xlim=(left, right), ylim=(bottom, top), facecolor=GROUND, xticks=[], yticks=[])
    axes.set_aspect("equal", adjustable="box")
    axes.grid(visible=False)
    axes.spines[:].set_visible(False)
    ways: list[Artist] = object_layer.route(scene, broader=1.0 if color_by is None else 2.2)  # seen beside its colours
    if color_by is None:
        ways += object_layer.trails(scene, past)
    else:
        colored = object_layer.trajectories(scene, color_values(scene, color_by))
        style_colors(colored, limit or color_limit(scene, color_by))
        ways.append(colored)
        if has_legend:
            labels.color_bar(axes, colored, COLORS[color_by])
    moving = [*ways, *object_layer.boxes(scene, past[-1]), *object_layer.lights(scene, past[-1].timestep)]
    words = [*labels.scale_bar(axes), *labels.time(axes, past[-1].timestep * scene.dt)]
    for artist in (*map_artists(scene.map), *moving, *words):
        axes.add_artist(artist)
    if has_legend:
        labels.legend(axes, scene, past[-1])


def scenario_figure(
    scenario: ScenarioDescription | Scene, timestep: int | None = None, *, size: int = 800, **options: Any
) -> Figure:
    """A scenario as a figure of its own, which notebooks show and ``savefig`` writes.

    Args:
        scenario: What is drawn.
        timestep: When; the current timestep for None.
        size: Longer side [pixel]; for pdf and svg, 1/100 inch.
        options: See :func:`draw_scenario`.
    """
    figure = new_figure(1.0, 1.0, dpi=DPI, facecolor=GROUND)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    draw_scenario(axes, scenario, timestep, **options)
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    scale = size / max(right - left, top - bottom) / DPI
    figure.set_size_inches((right - left) * scale, (top - bottom) * scale)
    return figure


def window(view: str, scene: Scene, moment: Moment, width: float) -> Window:
    """What is seen.

    Raises:
        BadParameter: There is no such view.
    """
    if view == "route":
        return Window.on_route(scene)
    if view == "all":
        return Window.on_everything(scene)
    if view == "ego":
        x, y = moment.position[scene.ego].tolist()
        return Window(x, y, width, width)
    raise BadParameter(f"no view {view!r}; there are {', '.join(VIEWS)}")


@dataclass(frozen=True)
class Drawing:
    """How a scenario is drawn into a file.

    Attributes:
        view: See :func:`draw_scenario`; None: the route in a picture, the ego in a video.
        width: What the view ``ego`` sees across [m].
        size: Longer side [pixel].
        speed: Of a video; 2 is twice as fast as it was.
        color_by: Of a picture, see :func:`draw_scenario`.
    """

    view: str | None = None
    width: float = 100.0
    size: int = 1000
    speed: float = 1.0
    color_by: str | None = None

    def save(
        self,
        path: Path | str,
        scenario: ScenarioDescription | Scene,
        moments: Sequence[Moment] | None = None,
        now: int = -1,
        on_frame: Callable[[int], None] | None = None,
    ) -> int:
        """Write a picture of one moment, or a video of all.

        Args:
            path: Its ending says what is written: .png, .pdf, .svg, .gif or .mp4.
            scenario: What is drawn.
            moments: What happened, in order, if not what was recorded.
            now: The moment of a picture.
            on_frame: Told how many frames of a video are done.

        Returns:
            Number of frames.

        Raises:
            BadParameter: The name ends otherwise.
            MissingDependency: An mp4, without PyAV.
        """
        kind, scene = Path(path).suffix, Scene.of(scenario)
        if kind not in (*PICTURES, *VIDEOS):
            raise BadParameter(f"{path}: give a name that ends with one of {', '.join((*PICTURES, *VIDEOS))}")
        shown = scene.moments() if moments is None else moments
        if kind in PICTURES:
            past, view = until(shown, range(len(shown))[now]), self.view or "route"
            figure = scenario_figure(
                scene, size=self.size, view=view, width=self.width, moments=past, color_by=self.color_by
            )
            write_figure(path, figure)
            return 1
        view = self.view or "ego"
        camera = TopDown(scene, window(view, scene, shown[0], self.width), self.size, follows=view == "ego")
        frames = (camera.frame(until(shown, last)) for last in range(len(shown)))
        write_video(path, frames, self.speed / scene.dt, on_frame)
        return len(shown)


def until(moments: Sequence[Moment], last: int) -> Sequence[Moment]:
    """The moments that a picture of the last of them shows as trails."""
    return moments[max(last - TRAIL, 0) : last + 1]


def _past(scene: Scene, timestep: int | None) -> list[Moment]:
    now = scene.current_timestep if timestep is None else timestep
    if not 0 <= now < scene.num_steps:
        raise BadParameter(f"{scene.scenario_id}: no timestep {now}; there are 0 to {scene.num_steps - 1}")
    return [scene.moment(k) for k in range(max(now - TRAIL, 0), now + 1)]


def color_values(scene: Scene, color_by: str) -> npt.NDArray[np.floating]:
    """(T, N) the number that colours ways.

    Raises:
        BadParameter: There is no such number.
    """
    if color_by not in COLORS:
        raise BadParameter(f"no colours by {color_by!r}; there are {', '.join(COLORS)}")
    seconds = np.arange(scene.num_steps) * scene.dt
    return np.repeat(seconds[:, None], scene.num_objects, axis=1) if color_by == "time" else scene.speed


def color_limit(scene: Scene, color_by: str) -> float:
    """The largest of these numbers in a scenario."""
    return max(float(color_values(scene, color_by)[scene.present].max(initial=0.0)), 1.0)


def style_colors(mappable: ScalarMappable, limit: float) -> None:
    """From 0 to the limit in the colours of numbers."""
    mappable.set_cmap(COLORMAP)
    mappable.set_clim(0.0, limit)


def _no_strip(seen: Window) -> float:
    """A window's ratio of width to height, kept readable."""
    return float(np.clip(seen.width / seen.height, *_RATIOS))
