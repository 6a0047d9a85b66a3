"""``scenarionet render``: draw a picture or a video of a scenario."""

from __future__ import annotations

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
    from scenarionet_data import Lake, ScenarioDescription
    from scenarionet_data.plots import Moment, Scene


@verb(
    "render",
    "scenarionet render lake pg/v1/3 -o scenario.png",
    "scenarionet render lake pg/v1/3 -o scenario.pdf --at 5 --view all",
    "scenarionet render lake pg/v1/3 -o speeds.png --color-by speed",
    "scenarionet render lake pg/v1/3 -o scenario.mp4 --width 80",
    "scenarionet render lake pg/v1/3 -o driven.mp4 --run straight_on",
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
    type=click.Choice(["route", "ego", "all"]),
    help="Frame the route, follow the ego, or show everything. [default: route in pictures, ego in videos]",
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
    width: float,
    size: int,
    speed: float,
    color_by: str | None,
    snapshot: int | None,
    replace: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """Draw a top-down picture or video of a scenario.

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
    if run is None:
        scene = Scene.of(scenario)
        moments = scene.moments()
    else:
        scene, moments = _rollout(opened, run, scenario)
    now = scene.current_timestep if at is None else round(at / scene.dt)
    now = min(max(now - moments[0].timestep, 0), len(moments) - 1)
    with ProgressDisplay(f"render {path.name}", "frame", is_quiet=quiet) as progress:
        drawing = Drawing(view, width, size, speed, color_by)
        frames = drawing.save(path, scene, moments, now, lambda done: progress.update(done, len(moments), 0))
    num_bytes = path.stat().st_size
    if as_json:
        output.print_json({"scenario_id": scenario.id, "file": file, "frames": frames, "bytes": num_bytes})
    else:
        click.echo(f"{file}: {scenario.id}, {output.count(frames, 'frame')}, {output.size(num_bytes)}")


def _rollout(lake: Lake, run: str, scenario: ScenarioDescription) -> tuple[Scene, list[Moment]]:
    from scenarionet_data import resample
    from scenarionet_data.plots import Scene
    from scenarionet_sim import rollout_moments
    from scenarionet_sim.worlds.world import STEP

    scene = Scene.of(resample(scenario, STEP))
    return scene, rollout_moments(lake, run, scene)
