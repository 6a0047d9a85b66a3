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

    With --minari, a policy drives the ego instead, and its episodes of observations, actions and rewards are written as
    a dataset of Minari, for offline learning. The policy `log-planner` drives as recorded, by inverse dynamics.

    Finished scenarios are kept: run the same command again to continue after an interruption.
    """

    examples = (
        "scenarionet runs record lake busy_train",
        "scenarionet runs record lake busy_train --agents ego --name ego_states",
        "scenarionet runs record lake busy_train --minari busy/recorded-v0",
        "scenarionet runs record lake busy_train --minari busy/idm-v0 --policy idm-planner --observation route",
    )
    database: str | None = OPTIONAL_DATABASE
    agents: str = option("Agents that observe: vehicles or ego.", default="vehicles", metavar="NAME")
    camera: str | None = option("Record what a camera on every agent sees, too, in colour.", metavar="WIDTHxHEIGHT")
    name: str | None = option("Name of the run. [default: DATABASE-AGENTS-observed]", metavar="NAME")
    seed: int = option("Seed of the sensor noise.", default=0)
    minari: str | None = option("Write episodes as this dataset of Minari.", metavar="NAMESPACE/NAME-vN")
    policy: str = option(
        "With --minari: a planner, or runs/NAME of a training run.", default="log-planner", metavar="NAME"
    )
    observation: str = option("With --minari: paper or route.", default="paper", metavar="NAME")

    def run(self) -> None:
        if self.minari:
            self._record_episodes(self.minari)
            return
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

    def _record_episodes(self, dataset_id: str) -> None:
        from scenarionet_sim import Scenarios, record_episodes

        if self.camera or self.name or self.agents != "vehicles":
            raise click.UsageError("--minari records the ego alone, without --agents, --camera and --name")
        scenarios = Scenarios(self.lake, self.chosen(self.database))
        started = time.monotonic()
        with (
            self.progress(f"record {dataset_id}", "scenario") as progress,
            keeping(lambda: f"finished scenarios are kept in dataset {dataset_id}"),
        ):
            dataset = record_episodes(
                scenarios, dataset_id, self.policy, observation=self.observation, seed=self.seed,
                on_progress=progress.update,
            )  # fmt: skip
        episodes, steps, took = int(dataset.total_episodes), dataset.total_steps, time.monotonic() - started
        self.say(
            {"dataset": dataset_id, "episodes": episodes, "steps": steps, "seconds": took},
            [
                f"{dataset_id}: {count(steps, 'step')} of {count(episodes, 'episode')}, took {duration(took)}",
                f"Read it: minari.load_dataset('{dataset_id}')",
            ],
        )


def pixels(size: str) -> tuple[int, int]:
    """Parse WIDTHxHEIGHT."""
    width, _, height = size.partition("x")
    if not (width.isdecimal() and height.isdecimal()):
        raise click.BadParameter(f"--camera expected WIDTHxHEIGHT [pixels], for example 320x180, found {size!r}")
    return int(width), int(height)
