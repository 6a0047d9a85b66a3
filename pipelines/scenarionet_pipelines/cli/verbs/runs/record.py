"""``scenarionet runs record``: record the observations of vehicles for imitation learning."""

from __future__ import annotations

import time

import click

from scenarionet_pipelines.cli.interrupt import keeping
from scenarionet_pipelines.cli.output import count, duration
from scenarionet_pipelines.cli.verb import OPTIONAL_DATABASE, Choosing, Distributed, LakeVerb, option


class RecordVerb(LakeVerb, Choosing, Distributed):
    """Record what every vehicle observes along its logged trajectory, for imitation learning.

    The view `observations` has one row per vehicle and timestep, with the paper's observation as a list. The rows are
    states without actions, the paper's dataset for multi-agent imitation. With --camera, the view `frames` has one row
    per vehicle and timestep with its picture.

    Finished scenarios are kept: run the same command again to continue after an interruption.
    """

    examples = (
        "scenarionet runs record lake busy_train",
        "scenarionet runs record lake busy_train --agents ego --name ego_states",
    )
    database: str | None = OPTIONAL_DATABASE
    agents: str = option("Agents that observe: vehicles or ego.", default="vehicles", metavar="NAME")
    camera: str | None = option("Record what a camera on every agent sees, too, in colour.", metavar="WIDTHxHEIGHT")
    name: str | None = option("Name of the run. [default: DATABASE-AGENTS-observed]", metavar="NAME")
    seed: int = option("Seed of the sensor noise.", default=0)

    def run(self) -> None:
        from scenarionet_sim import record
        from scenarionet_sim.sensors.camera import Camera

        run = self.name or f"{self.source(self.database)}-{self.agents}-observed".replace("@", ".")
        started = time.monotonic()
        with (
            self.execution() as execution,
            self.progress(f"record {run}", "part") as progress,
            keeping(lambda: f"finished scenarios are kept in run {run}"),
        ):
            skipped = record(**self.given(record) | {
                "database": self.chosen(self.database),
                "name": run, "cameras": (Camera(*pixels(self.camera)),) if self.camera else (),
                "workers": self.num_workers, "executor": execution.executor, "on_progress": progress.update,
            })  # fmt: skip
        query = "SELECT count(*), count(DISTINCT scenario_id) FROM observations WHERE run = $run"
        rows, scenarios = self.open().sql(query, {"run": run}).row(0)
        took = time.monotonic() - started
        rest = f"SELECT * FROM observations WHERE run = '{run}' LIMIT 3"
        self.say(
            {"run": run, "scenarios": scenarios, "skipped": skipped, "observations": rows, "seconds": took},
            [
                f"{run}: {count(rows, 'observation')} of {count(scenarios, 'scenario')}, took {duration(took)}",
                f'Query them: scenarionet sql {self.lake} "{rest}"',
            ],
        )


def pixels(size: str) -> tuple[int, int]:
    """Parse WIDTHxHEIGHT."""
    width, _, height = size.partition("x")
    if not (width.isdecimal() and height.isdecimal()):
        raise click.BadParameter(f"--camera expected WIDTHxHEIGHT [pixels], for example 320x180, found {size!r}")
    return int(width), int(height)
