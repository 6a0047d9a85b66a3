"""``scenarionet render``: draw a picture or a video of a scenario."""

from __future__ import annotations

from dataclasses import replace as replaced
from typing import TYPE_CHECKING

import click

from scenarionet_data.errors import BadParameter
from scenarionet_data.storage.files.places import local_path
from scenarionet_pipelines.cli import output
from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.parameters import (
    json_option,
    lake_argument,
    quiet_option,
    replace_option,
    snapshot_option,
)
from scenarionet_pipelines.cli.progress import ProgressDisplay

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from scenarionet_data import Lake, ScenarioDescription
    from scenarionet_data.plots import Moment, Scene


@verb(
    "render",
    "scenarionet render lake pg/v1/3 -o scenario.png",
    "scenarionet render lake pg/v1/3 -o scenario.pdf --at 5 --view all",
    "scenarionet render lake pg/v1/3 -o speeds.png --color-by speed",
    "scenarionet render lake pg/v1/3 -o scenario.mp4 --width 80",
    "scenarionet render lake pg/v1/3 -o driven.mp4 --run straight_on",
    "scenarionet render lake pg/v1/3 -o street.png --view chase --at 4 --weather dusk",
)
@lake_argument
@click.argument("scenario_id", metavar="ID")
@click.option(
    "-o",
    "--output",
    "file",
    required=True,
    metavar="FILE",
    help="Output: .png, .pdf or .svg; .gif or .mp4 for a video.",
)
@click.option("--run", metavar="NAME", help="Draw this run of `scenarionet sim` instead of the recording.")
@click.option("--at", type=click.FloatRange(0.0), help="Time of the picture [s]. [default: the current timestep]")
@click.option(
    "--view",
    type=click.Choice(["route", "ego", "all", "camera", "chase", "cockpit", "orbit"]),
    help="Frame the route, follow the ego, or show everything from above; or in space: the ego's camera, behind the "
    "ego, at its driver's eyes, or around it. [default: route in pictures, ego in videos]",
)
@click.option(
    "--weather",
    type=click.Choice(["day", "dusk", "overcast", "rain"]),
    default="day",
    show_default=True,
    help="Weather of the views in space.",
)
@click.option(
    "--width", type=click.FloatRange(1.0), default=100.0, show_default=True, help="Width of the view `ego` [m]."
)
@click.option(
    "--size", type=click.IntRange(64, 8192), default=1000, show_default=True, help="Length of the longer side [pixel]."
)
@click.option("--speed", type=click.FloatRange(0.01), default=1.0, show_default=True, help="Playback speed of a video.")
@click.option(
    "--color-by",
    type=click.Choice(["time", "speed"]),
    help="Draw whole trajectories in a picture, coloured by time or speed.",
)
@snapshot_option
@replace_option
@json_option
@quiet_option
def command(
    lake: str,
    scenario_id: str,
    file: str,
    run: str | None,
    at: float | None,
    view: str | None,
    weather: str,
    width: float,
    size: int,
    speed: float,
    color_by: str | None,
    snapshot: int | None,
    replace: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """Draw a picture or video of a scenario, from above or in space.

    ID is the id of the scenario or any part of it that is unique in the lake. The ego and its route are orange, lane
    lines have their real colours and dashes, traffic lights differ in colour and shape, trails show the last two
    seconds. Requires the extra `plots`, and `video` for mp4; no display is needed.
    """
    from scenarionet_data import Lake, ScenarioLoader
    from scenarionet_data.plots import Drawing, Scene

    path = local_path(file, "a picture or video")
    if path.exists() and not replace:
        raise BadParameter(f"{file} exists; choose another name, or --replace")
    opened = Lake(lake, snapshot)
    scenario = ScenarioLoader(opened, [opened.describe(scenario_id)["scenario_id"]])[0]
    is_in_space = view in ("camera", "chase", "cockpit", "orbit")
    if is_in_space and color_by is not None:
        raise BadParameter(f"--color-by draws trajectories from above; leave it out with --view {view}")
    if run is not None:
        scene, moments = _rollout(opened, run, scenario)
    elif is_in_space:
        scene, moments = _recording(scenario)
    else:
        scene = Scene.of(scenario)
        moments = scene.moments()
    now = scene.current_timestep if at is None else round(at / scene.dt)
    now = min(max(now - moments[0].timestep, 0), len(moments) - 1)
    with ProgressDisplay(f"render {path.name}", "frame", is_quiet=quiet) as progress:

        def on_frame(done: int) -> None:
            progress.update(done, len(moments), 0)

        if view is not None and is_in_space:
            frames = _film(path, scenario, view, weather, size, moments, now, speed, on_frame)
        else:
            frames = Drawing(view, width, size, speed, color_by).save(path, scene, moments, now, on_frame)
    num_bytes = path.stat().st_size
    if as_json:
        output.print_json({"scenario_id": scenario.id, "file": file, "frames": frames, "bytes": num_bytes})
    else:
        click.echo(f"{file}: {scenario.id}, {output.count(frames, 'frame')}, {output.size(num_bytes)}")


def _recording(scenario: ScenarioDescription) -> tuple[Scene, list[Moment]]:
    from scenarionet_sim.render.scenes import scene_of
    from scenarionet_sim.render.space import recorded_moments
    from scenarionet_sim.worlds.world import World

    world = World.from_scenario(scenario)
    return replaced(scene_of(world), current_timestep=round(scenario.current_timestep * scenario.dt / world.dt)), (
        recorded_moments(world)
    )


def _film(
    path: Path,
    scenario: ScenarioDescription,
    view: str,
    weather: str,
    size: int,
    moments: list[Moment],
    now: int,
    speed: float,
    on_frame: Callable[[int], None],
) -> int:
    """Write a picture or video in space; return the number of frames."""
    from PIL import Image

    from scenarionet_data.plots.files import VIDEOS, write_video
    from scenarionet_sim.cameras.weather import WEATHERS
    from scenarionet_sim.render.space import Film
    from scenarionet_sim.worlds.world import World

    world = World.from_scenario(scenario)
    film = Film(view, size // 2 * 2, size * 9 // 32 * 2, WEATHERS[weather])
    if path.suffix in VIDEOS:
        write_video(path, film.frames(world, moments), speed / world.dt, on_frame)
        return len(moments)
    if path.suffix != ".png":
        raise BadParameter(f"{path}: a picture of --view {view} is a .png, a video a .gif or .mp4")
    Image.fromarray(next(film.frames(world, moments[now : now + 2]))).save(path)
    return 1


def _rollout(lake: Lake, run: str, scenario: ScenarioDescription) -> tuple[Scene, list[Moment]]:
    from scenarionet_data import resample
    from scenarionet_data.plots import Scene
    from scenarionet_sim import rollout_moments
    from scenarionet_sim.worlds.world import STEP

    scene = Scene.of(resample(scenario, STEP))
    return scene, rollout_moments(lake, run, scene)
