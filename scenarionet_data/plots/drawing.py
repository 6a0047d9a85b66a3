"""Top-down drawings of scenarios: in axes, as a figure or grid of figures, or as a file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.figure import Figure

from scenarionet_data.arrays.dtypes import is_count
from scenarionet_data.errors import BadParameter
from scenarionet_data.plots import labels, object_layer
from scenarionet_data.plots.files import PICTURES, VIDEOS, write_figure, write_video
from scenarionet_data.plots.map_layer import map_artists
from scenarionet_data.plots.palette import COLORMAP, GROUND
from scenarionet_data.plots.scene import Moment, Scene, Window
from scenarionet_data.plots.style import new_figure, plain, styled
from scenarionet_data.plots.topdown import DPI, TRAIL, TopDown
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.scenario.settings import Count, Positive, check_settings
from scenarionet_data.storage.files.places import local_path

_RATIOS = 0.75, 1.8
"""Minimum and maximum default aspect ratio (width / height) of a picture."""

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
    """Draw a scenario into axes: map, trajectories, boxes with headings, traffic lights, scale bar, time and legend.

    The data coordinates of the axes become metres with equal aspect; only these axes are changed.

    Args:
        axes: Axes of any figure and layout.
        scenario: The scenario.
        timestep: Timestep to draw; the current timestep by default.
        view: ``route`` frames the route of the ego, ``ego`` follows the ego, ``all`` frames everything.
        width: Width of the view ``ego`` [m].
        ratio: Aspect ratio (width / height); by default that of the view, limited to a readable range.
        color_by: ``time`` or ``speed`` draws whole trajectories in these colours with a colour bar; by default the
            last two seconds are drawn as fading trails.
        limit: Upper limit of the colour scale, for pictures that share a colour bar; by default the maximum of this
            scenario.
        moments: Object states up to ``timestep``, for example of a simulation; the recording by default.
        has_legend: Draw a legend or colour bar.

    Raises:
        BadParameter: The timestep, view or colour does not exist.

    Example:
        figure = matplotlib.figure.Figure()
        draw_scenario(figure.subplots(), scenario, timestep=20, color_by="speed")
    """
    scene = Scene.of(scenario)
    past = _past(scene, timestep) if moments is None else moments
    seen = window(view, scene, past[-1], width)
    left, right, bottom, top = seen.shaped(ratio or float(np.clip(seen.width / seen.height, *_RATIOS))).corners
    axes.set(xlim=(left, right), ylim=(bottom, top), facecolor=GROUND, xticks=[], yticks=[])
    axes.set_aspect("equal", adjustable="box")
    axes.grid(visible=False)
    axes.spines[:].set_visible(False)
    ways: list[Artist] = object_layer.route(
        scene, broader=1.0 if color_by is None else 2.2
    )  # wider than the coloured trajectory on it
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
    scenario: ScenarioDescription | Scene,
    timestep: int | None = None,
    *,
    size: int = 800,
    view: str = "route",
    width: float = 100.0,
    ratio: float | None = None,
    color_by: str | None = None,
    limit: float | None = None,
    moments: Sequence[Moment] | None = None,
    has_legend: bool = True,
) -> Figure:
    """Draw a scenario into a new figure, which notebooks display and ``savefig`` writes.

    Args:
        scenario: The scenario.
        timestep: Timestep to draw; the current timestep by default.
        size: Length of the longer side [pixel], or [1/100 inch] for pdf and svg.
        view, width, ratio, color_by, limit, moments, has_legend: See :func:`draw_scenario`.
    """
    if not is_count(size, 1):
        raise BadParameter(f"size={size!r}; expected a whole number of 1 or more")
    figure = new_figure(1.0, 1.0, dpi=DPI, facecolor=GROUND)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    draw_scenario(
        axes,
        scenario,
        timestep,
        view=view,
        width=width,
        ratio=ratio,
        color_by=color_by,
        limit=limit,
        moments=moments,
        has_legend=has_legend,
    )
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    scale = size / max(right - left, top - bottom) / DPI
    figure.set_size_inches((right - left) * scale, (top - bottom) * scale)
    return figure


def window(view: str, scene: Scene, moment: Moment, width: float) -> Window:
    """Return the window of a view.

    Raises:
        BadParameter: The view does not exist.
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
    """Settings for drawing a scenario to a file.

    Attributes:
        view: See :func:`draw_scenario`; by default the route in pictures and the ego in videos.
        width: Width of the view ``ego`` [m].
        size: Length of the longer side [pixel].
        speed: Playback speed of a video; 2 is twice the real speed.
        color_by: Colours of a picture, see :func:`draw_scenario`.
    """

    view: str | None = None
    width: Positive = 100.0
    size: Count = 1000
    speed: Positive = 1.0
    color_by: str | None = None

    def __post_init__(self) -> None:
        check_settings(self)

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
            path: File to write; its suffix selects the format: .png, .pdf, .svg, .gif or .mp4.
            scenario: The scenario.
            moments: Object states in order, for example of a simulation; the recording by default.
            now: Index of the moment of a picture.
            on_frame: Called with the number of finished frames of a video.

        Returns:
            Number of frames.

        Raises:
            BadParameter: The suffix is not supported.
            MissingDependency: The file is an mp4 and PyAV is not installed.
        """
        path, scene = local_path(path, "a picture"), Scene.of(scenario)
        kind = path.suffix
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
    """Return the moments up to one moment that its picture shows as trails."""
    return moments[max(last - TRAIL, 0) : last + 1]


def _past(scene: Scene, timestep: int | None) -> list[Moment]:
    now = scene.timestep(timestep)
    return [scene.moment(k) for k in range(max(now - TRAIL, 0), now + 1)]


def color_values(scene: Scene, color_by: str) -> npt.NDArray[np.floating]:
    """Return the values (T, N) that colour the trajectories.

    Raises:
        BadParameter: The colour does not exist.
    """
    if color_by not in COLORS:
        raise BadParameter(f"no colours by {color_by!r}; there are {', '.join(COLORS)}")
    seconds = np.arange(scene.num_steps) * scene.dt
    return np.repeat(seconds[:, None], scene.num_objects, axis=1) if color_by == "time" else scene.speed


def color_limit(scene: Scene, color_by: str) -> float:
    """Return the maximum of these values in a scenario."""
    return max(float(color_values(scene, color_by)[scene.present].max(initial=0.0)), 1.0)


def style_colors(mappable: ScalarMappable, limit: float) -> None:
    """Set the colour map and its range, from 0 to the limit."""
    mappable.set_cmap(COLORMAP)
    mappable.set_clim(0.0, limit)


def small_multiples(
    scenarios: Sequence[ScenarioDescription | Scene],
    titles: Sequence[str] | None = None,
    *,
    timesteps: Sequence[int | None] | None = None,
    columns: int = 4,
    side: float = 2.6,
    view: str = "ego",
    width: float = 80.0,
    ratio: float = 1.0,
    color_by: str | None = None,
    has_legend: bool = False,
) -> Figure:
    """Draw several scenarios in a grid, all in the same style.

    Args:
        scenarios: The scenarios.
        titles: Title of each scenario; its id by default.
        timesteps: Timestep of each scenario; its current timestep by default.
        columns: Number of columns.
        side: Side of one picture [inch].
        view, width, ratio: See :func:`draw_scenario`.
        color_by: See :func:`draw_scenario`; the scenarios share one colour bar.
        has_legend: Draw a legend in each picture.

    Raises:
        BadParameter: No scenarios are given, or no number of columns.
    """
    if not isinstance(scenarios, Sequence | None):
        raise BadParameter(f"scenarios: expected several, such as [scenario], found {scenarios!r}")
    if not scenarios:
        raise BadParameter("no scenarios to draw; an empty selection has no pictures")
    if not is_count(columns, 1):
        raise BadParameter(f"columns: expected a whole number of 1 or more, found {columns!r}")
    columns = min(columns, len(scenarios))
    num_rows = -(-len(scenarios) // columns)
    with styled():
        figure = new_figure(side * columns, (side + 0.25) * num_rows, layout="constrained")
        panels = list(figure.subplots(num_rows, columns, squeeze=False).flat)
        scenes = [Scene.of(scenario) for scenario in scenarios]
        limit = max(color_limit(scene, color_by) for scene in scenes) if color_by else None
        if color_by and limit is not None:
            colors = ScalarMappable()
            style_colors(colors, limit)
            figure.colorbar(colors, ax=panels, location="bottom", shrink=0.4, aspect=40, label=COLORS[color_by])
        for place, panel in enumerate(panels):
            if place >= len(scenarios):
                panel.set_visible(False)
                continue
            draw_scenario(
                panel,
                scenes[place],
                timesteps[place] if timesteps else None,
                view=view,
                width=width,
                ratio=ratio,
                color_by=color_by,
                limit=limit,
                has_legend=has_legend,
            )
            words = titles[place] if titles else scenes[place].scenario_id
            panel.set_title(plain(words, 34), fontsize=8)
    return figure
