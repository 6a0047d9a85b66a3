"""``scenarionet sim``: evaluate a driving policy on every scenario of a database."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import click

from scenarionet_pipelines.cli.execution import worker_facts, worker_rows
from scenarionet_pipelines.cli.interrupt import keeping
from scenarionet_pipelines.cli.output import count, duration, table
from scenarionet_pipelines.cli.parameters import look_in_current_folder
from scenarionet_pipelines.cli.verb import EGO, MARGIN, OPTIONAL_DATABASE, Choosing, Distributed, LakeVerb, option
from scenarionet_pipelines.messages import one_line

if TYPE_CHECKING:
    from scenarionet_sim.evaluation.specification import Evaluation


class SimVerb(LakeVerb, Choosing, Distributed):
    """Evaluate a policy on every scenario of a database, or of the whole lake.

    The view `results` has one row per scenario and rollout with every metric, the view `rollouts` the driven
    trajectories. Join them with metadata by scenario_id to find out where a planner fails.

    Beside the results stand those of the recording itself, a ceiling, and of constant velocity and random actions, the
    floors, on the same scenarios. They are runs, too, and simulated once.

    A policy of your own is module:Class: a subclass of scenarionet_sim.Planner, whose method act(view) returns an
    action or a trajectory; a class with a method act(observation) that returns steering and throttle in [-1, 1] for
    the paper's observation, or that of its attribute `sensors`; or a subclass of scenarionet_sim.Policy.

    --from NAME drives the moments that `scenarionet mine --name NAME` has kept instead, each as a scenario of its own
    from --margin before it begins until as long after it ends; with --ego actor in the place of the one who has that
    role. They are saved as the database NAME-EGO, as `scenarionet filter --moments` does.

    Finished scenarios are kept: run the same command again to continue after an interruption.
    """

    examples = (
        "scenarionet sim lake busy_val --policy idm",
        "scenarionet sim lake busy_val --policy my_planner:Planner --backend kinematic --traffic idm --workers 4",
        "scenarionet sim lake busy_val --policy runs/busy_train-ppo-seed0 --workers 4",
        "scenarionet sim lake busy_val --policy git:main:my_planner:Planner --name main",
        "scenarionet sim lake busy_val --policy git:v1.0:my_planner:Planner --python requirements.txt",
        "scenarionet sim lake busy_val --policy idm --name idm_twice --json",
        "scenarionet sim lake busy_val --policy idm-sampled --traffic idm-sampled --rollouts 32 --seed 0",
        "scenarionet sim lake busy_val --policy idm --traffic model:clone",
        "scenarionet sim lake busy_val --policy idm --order-by 'difficulty DESC' --limit 20",
        "scenarionet sim lake --from risky --ego actor --policy idm --name cutting_in",
        "scenarionet sim lake busy_val --policy idm --cluster tcp://10.0.0.5:8786",
    )
    database: str | None = OPTIONAL_DATABASE
    moments: str | None = option("Drive the moments that are kept under this name.", "--from", metavar="NAME")
    ego: str = EGO
    margin: float = MARGIN
    policy: str = option(
        "Policy of the ego: replay, idm, idm-sampled, constant, constant-noisy, random, a planner (log-planner, "
        "constant-planner, pure-pursuit, idm-planner, lane-graph), runs/NAME of a training run, ros2:dds, "
        "ros2:zenoh or ros1:tcp for a stack of ROS, autoware:dds, openpilot:msgq, driver:PORT for a driver of any "
        "language, carla:agent.py:Class for an agent of CARLA's leaderboard, commonroad:reactive or "
        "commonroad:frenetix, which need an environment of their own, module:Class, or in a process of its own "
        "file.py:Class or git:REF:module:Class.",
        metavar="NAME",
    )
    traffic: str = option(
        "Policy of the others: replay, idm, idm-behind (only vehicles behind the ego react), idm-sampled, idm-walking "
        "(where pedestrians and cyclists react, too), constant, constant-noisy, or model:RUN of `traffic learn --kind "
        "tokens`, which can be the --policy as well.",
        default="replay",
        metavar="NAME",
    )
    backend: str = option(
        "Vehicle dynamics: kinematic, or bullet (pybullet, Python 3.11).", default="kinematic", metavar="NAME"
    )
    name: str | None = option("Name of the run. [default: DATABASE-POLICY-TRAFFIC-BACKEND]", metavar="NAME")
    num_rollouts: int = option(
        "Rollouts of each scenario, which differ if a policy is stochastic.",
        "--rollouts",
        type=click.IntRange(min=1),
        default=1,
        metavar="N",
    )
    seed: int = option("Seed of stochastic policies and of the sensor noise.", default=0)
    episode: str = option(
        "What to drive: the whole recording, 15 s of it, or 8 s after the history.",
        choices=("log", "nuplan", "wosac"),
        default="log",
    )
    tracker: str = option(
        "What follows the trajectories of a planner: nuPlan's LQR with a bicycle, or exactly.",
        choices=("lqr", "perfect"),
        default="lqr",
    )
    route: str = option(
        "Route of the ego: its recorded path, or the way along the lanes to the end of it.",
        choices=("log", "lanes"),
        default="log",
    )
    python: str = option(
        "Interpreter of another environment for the policy, with this version of this software, or a requirements file "
        "(.txt) of which one is made, once.",
        default="",
        show_default=False,
        metavar="FILE",
    )
    metrics_only: bool = option("Do not write the trajectories of the run.")
    no_references: bool = option("Do not simulate the recording, constant velocity and random actions.")

    def run(self) -> bool:
        from scenarionet_data import Lake
        from scenarionet_sim.drivers.by_name import drives_alone
        from scenarionet_sim.evaluation.evaluation import plan_evaluation, run_evaluation
        from scenarionet_sim.evaluation.references import missing_references, run_references

        look_in_current_folder(self.policy)
        database = self.chosen(self.database) if self.moments is None else self.cut(self.moments)
        evaluation = plan_evaluation(**self.given(plan_evaluation) | {"database": database})
        source = self.source(f"{self.moments}-{self.ego}" if self.moments else self.database)
        run = self.name or default_name(evaluation, source)
        workers = 1 if drives_alone(self.policy) else self.num_workers
        references: dict[str, str] = {}
        lake = Lake(self.lake, evaluation.snapshot)
        if isinstance(database, str):
            database = lake.database(database).scenario_ids
        scenarios = len(lake if database is None else database)
        runs = 1 if self.no_references else 1 + len(missing_references(evaluation))

        def report_progress(before: int, count: int, done: int, parts: int, _: int) -> None:
            progress.update(before + count * done // parts, runs * scenarios)

        with (
            self.execution() as execution,
            self.progress(f"sim {run}") as progress,
            keeping(lambda: f"finished scenarios are kept in run {run}"),
        ):
            progress.update(0, runs * scenarios)
            report = run_evaluation(
                evaluation,
                run,
                workers=workers,
                executor=execution.measured,
                rollouts=not self.metrics_only,
                on_progress=partial(report_progress, 0, scenarios),
            )
            if not self.no_references:
                on_progress = partial(report_progress, scenarios, (runs - 1) * scenarios)
                references = run_references(
                    evaluation, workers=workers, executor=execution.executor, on_progress=on_progress
                )
        facts, *others = (run_facts(self.lake, each) for each in (report.run, *references.values()))
        beside = dict(zip(references, others, strict=True))
        failed = f"results JOIN metadata USING (scenario_id) WHERE run = '{run}' AND success IS NOT TRUE"
        failures = f'scenarionet sql {self.lake} "SELECT * FROM {failed}"'
        broken = [{"scenario_id": scenario_id, "reason": reason} for scenario_id, reason in report.broken]
        done = {"run": report.run, "skipped": report.skipped, "seconds": report.seconds, "broken": broken}
        counts = {"scenarios": report.scenarios, "references": beside, "next": failures}
        rows = [(key, value, *(each.get(key) for each in others)) for key, value in facts.items() if value is not None]
        lines = table(rows[1:], ("", "this run", *beside)) + table(worker_rows(execution.stats, "part"))
        if report.skipped:
            lines.insert(0, f"skipped    {count(report.skipped, 'scenario')} finished by an earlier command")
        lines.append(f"run {report.run}, took {duration(report.seconds)}. Failures: {failures}")
        self.say(facts | done | counts | worker_facts(execution.stats), lines)
        self.complain(f"could not be simulated: {each}: {one_line(reason)}" for each, reason in report.broken)
        return not report.broken

    def cut(self, moments: str) -> list[str]:
        """Save the chosen moments as a database, and return the ids of its scenarios."""
        from scenarionet_data.variations import MomentChoice, cut_moments

        choice = MomentChoice(**self.given(MomentChoice))
        made = cut_moments(self.open(), moments, choice, name=f"{moments}-{self.ego}", replace=True)
        left_out = made.wanted - len(made.database)
        self.complain([f"{left_out} of {made.wanted} moments could not be cut out, see quarantine"] if left_out else [])
        return made.database.scenario_ids


def default_name(evaluation: Evaluation, database: str) -> str:
    """Return the name of the run, by the database as it was given, without its version."""
    from scenarionet_sim.drivers.code import policy_name

    words = [database, policy_name(evaluation.policy), evaluation.traffic, evaluation.backend]
    words += [value for value in (evaluation.episode, evaluation.route) if value != "log"]
    words += [] if evaluation.tracker == "lqr" else [evaluation.tracker]
    return "-".join(words).replace("@", ".").replace(":", ".").replace("/", ".")


def run_facts(lake: str, run: str) -> dict[str, Any]:
    """Return the summary of a run; empty without rows."""
    from scenarionet_data import Lake

    rows = Lake(lake).named_query("runs", {"run": run}).to_dicts()
    return rows[0] if rows else {}
