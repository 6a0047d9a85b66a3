"""``scenarionet render``: a picture or a video of one scenario, from above."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from scenarionet_data.errors import BadParameter
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
    from scenarionet_data import Lake
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
@click.option("-o", "--output", "file", required=True, help="What to write: .png .pdf .svg, or a video: .gif .mp4")
@click.option("--run", help="Draw what happened in this run of `scenarionet sim`, not what was recorded.")
@click.option("--at", type=click.FloatRange(0.0), help="A picture's time [s]; the current timestep, if not given.")
@click.option(
    "--view",
    type=click.Choice(["route", "ego", "all"]),
    help="The ego's whole route (pictures), the ego in the middle (videos), or everything recorded.",
)
@click.option("--width", type=click.FloatRange(1.0), default=100.0, show_default=True, help="Of the view `ego` [m].")
@click.option("--size", type=click.IntRange(64, 8192), default=1000, show_default=True, help="Longer side [pixel].")
@click.option("--speed", type=click.FloatRange(0.01), default=1.0, show_default=True, help="A video's; 2 is twice.")
@click.option("--color-by", type=click.Choice(["time", "speed"]), help="A picture's: whole ways in these colours.")
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
    """Draw a scenario from above: a picture for a paper, or a video.

    ID is the scenario's id, or a part of it that only this scenario has. Lines have their true colours and dashes,
    the ego is orange like its route, lights differ in colour and shape; trails show the last two seconds.
    Pictures need the extra `plots`, mp4 the extra `video`; no display is needed.
    """
    from scenarionet_data import Lake, ScenarioLoader
    from scenarionet_data.plots import Drawing, Scene

    path = Path(file)
    if path.exists() and not replace:
        raise BadParameter(f"{file} is there already; give another name, or --replace")
    opened = Lake(lake, snapshot)
    scenario = ScenarioLoader(opened, [opened.describe(scenario_id)["scenario_id"]])[0]
    scene = Scene.of(scenario)
    moments = scene.moments() if run is None else _rollout_moments(opened, run, scene)
    now = scenario.current_timestep if at is None else round(at / scene.dt)
    now = min(max(now - moments[0].timestep, 0), len(moments) - 1)
    with ProgressDisplay(f"render {path.name}", "frame", is_quiet=quiet) as progress:
        drawing = Drawing(view, width, size, speed, color_by)
        frames = drawing.save(path, scene, moments, now, lambda done: progress.update(done, len(moments), 0))
    num_bytes = path.stat().st_size
    if as_json:
        output.print_json({"scenario_id": scenario.id, "file": file, "frames": frames, "bytes": num_bytes})
    else:
        click.echo(f"{file}: {scenario.id}, {output.count(frames, 'frame')}, {output.size(num_bytes)}")


def _rollout_moments(lake: Lake, run: str, scene: Scene) -> list[Moment]:
    from scenarionet_sim import rollout_moments

    return rollout_moments(lake, run, scene)
