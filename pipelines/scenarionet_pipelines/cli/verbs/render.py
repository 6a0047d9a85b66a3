"""``scenarionet render``: draw a picture or a video of a scenario."""

from __future__ import annotations

from dataclasses import replace as replaced
from typing import TYPE_CHECKING

import click

from scenarionet_data.errors import BadParameter
from scenarionet_pipelines.cli import output
from scenarionet_pipelines.cli.parameters import FiniteRange, output_path
from scenarionet_pipelines.cli.verb import REPLACE, SNAPSHOT, LakeVerb, Progressing, argument, option

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from scenarionet_data import ScenarioDescription
    from scenarionet_data.plots import Moment

_IN_SPACE = ("camera", "chase", "cockpit", "orbit")


class RenderVerb(LakeVerb, Progressing):
    """Draw a picture or video of a scenario, from above or in space.

    ID is the id of the scenario or any part of it that is unique in the lake. The ego and its route are orange, lane
    lines have their real colours and dashes, traffic lights differ in colour and shape, trails show the last two
    seconds. Requires the extra `plots`, and `video` for mp4; no display is needed.
    """

    examples = (
        "scenarionet render lake pg/v2/3 -o scenario.png",
        "scenarionet render lake pg/v2/3 -o scenario.pdf --at 5 --view all",
        "scenarionet render lake pg/v2/3 -o speeds.png --color-by speed",
        "scenarionet render lake pg/v2/3 -o scenario.mp4 --width 80",
        "scenarionet render lake pg/v2/3 -o driven.mp4 --run straight_on",
        "scenarionet render lake pg/v2/3 -o street.png --view chase --at 4 --weather dusk",
    )
    scenario_id: str = argument("ID")
    file: str = option("Output: .png, .pdf or .svg; .gif or .mp4 for a video.", "-o", "--output", metavar="FILE")
    run_name: str | None = option(
        "Draw this run of `scenarionet sim` instead of the recording.", "--run", metavar="NAME"
    )
    at: float | None = option("Time of the picture [s]. [default: the current timestep]", type=FiniteRange(0.0))
    view: str | None = option(
        "Frame the route, follow the ego, or show everything from above; or in space: the ego's camera, behind the "
        "ego, at its driver's eyes, or around it. [default: route in pictures, ego in videos]",
        choices=("route", "ego", "all", *_IN_SPACE),
    )
    weather: str = option(
        "Weather of the views in space.", choices=("day", "dusk", "night", "overcast", "rain"), default="day"
    )
    width: float = option("Width of the view `ego` [m].", type=FiniteRange(1.0), default=100.0)
    size: int = option("Length of the longer side [pixel].", type=click.IntRange(64, 8192), default=1000)
    speed: float = option("Playback speed of a video.", type=FiniteRange(0.01), default=1.0)
    color_by: str | None = option(
        "Draw whole trajectories in a picture, coloured by time or speed.", choices=("time", "speed")
    )
    snapshot: int | None = SNAPSHOT
    replace: bool = REPLACE

    def run(self) -> None:
        from scenarionet_data import ScenarioLoader, resample
        from scenarionet_data.plots import Drawing, Scene
        from scenarionet_data.plots.files import VIDEOS

        path = output_path(self.file, "a picture or video", replace=self.replace)
        if self.at is not None and path.suffix in VIDEOS:
            raise BadParameter(f"--at {self.at:g}: {path.name} is a video, which has all times; a picture is a .png")
        opened = self.open()
        scenario = ScenarioLoader(opened, [opened.describe(self.scenario_id)["scenario_id"]])[0]
        if self.view in _IN_SPACE and self.color_by is not None:
            raise BadParameter(f"--color-by draws trajectories from above; leave it out with --view {self.view}")
        if self.run_name is not None:
            from scenarionet_sim import rollout_moments
            from scenarionet_sim.worlds.world import STEP

            scene = Scene.of(resample(scenario, STEP))
            moments = rollout_moments(opened, self.run_name, scene)
        elif self.view in _IN_SPACE:
            from scenarionet_sim.render.scenes import scene_of
            from scenarionet_sim.render.space import recorded_moments
            from scenarionet_sim.worlds.world import World

            world = World.from_scenario(scenario)
            current = round(scenario.current_timestep * scenario.dt / world.dt)
            scene, moments = replaced(scene_of(world), current_timestep=current), recorded_moments(world)
        else:
            scene = Scene.of(scenario)
            moments = scene.moments()
        now = scene.current_timestep if self.at is None else round(self.at / scene.dt)
        first, last = moments[0].timestep, moments[-1].timestep
        if self.at is not None and not first <= now <= last:
            raise BadParameter(
                f"--at {self.at:g}: wanted {first * scene.dt:g} to {last * scene.dt:g} s in {scenario.id}"
            )
        now = min(max(now - first, 0), len(moments) - 1)
        with self.progress(f"render {path.name}", "frame") as progress:

            def on_frame(done: int) -> None:
                progress.update(done, len(moments), 0)

            if self.view is not None and self.view in _IN_SPACE:
                frames = self.film(self.view, path, scenario, moments, now, on_frame)
            else:
                drawing = Drawing(self.view, self.width, self.size, self.speed, self.color_by)
                frames = drawing.save(path, scene, moments, now, on_frame)
        num_bytes = path.stat().st_size
        self.say(
            {"scenario_id": scenario.id, "file": self.file, "frames": frames, "bytes": num_bytes},
            f"{self.file}: {scenario.id}, {output.count(frames, 'frame')}, {output.size(num_bytes)}",
        )

    def film(
        self,
        view: str,
        path: Path,
        scenario: ScenarioDescription,
        moments: list[Moment],
        now: int,
        on_frame: Callable[[int], None],
    ) -> int:
        """Write a picture or video in space; return the number of frames."""
        from PIL import Image

        from scenarionet_data.plots.files import VIDEOS, write_video
        from scenarionet_sim.cameras.weather import WEATHERS
        from scenarionet_sim.render.space import Film
        from scenarionet_sim.worlds.world import World

        world = World.from_scenario(scenario)
        film = Film(view, self.size // 2 * 2, self.size * 9 // 32 * 2, WEATHERS[self.weather])
        if path.suffix in VIDEOS:
            write_video(path, film.frames(world, moments), self.speed / world.dt, on_frame)
            return len(moments)
        if path.suffix != ".png":
            raise BadParameter(f"{path}: a picture of --view {view} is a .png, a video a .gif or .mp4")
        Image.fromarray(next(film.frames(world, moments[now : now + 2]))).save(path)
        return 1
