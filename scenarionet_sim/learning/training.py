"""Training runs: rounds of experience and updates, with metrics and checkpoints in the lake's results.

A run that was killed continues from its newest checkpoint and ends with the same weights, to the bit, as one that was
not: the checkpoint has the environment, all random states, the optimizers and the experience that is kept. This holds
on one machine with one torch thread, which a run uses.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
import torch

from scenarionet_data import Database, Lake, version
from scenarionet_data.errors import LakeError
from scenarionet_data.storage import checkpoints, evaluation_runs
from scenarionet_data.storage.evaluation_runs import EvaluationRun
from scenarionet_data.storage.files.places import open_files
from scenarionet_sim.environments.config import OBSERVATIONS, EnvConfig, MultiAgentConfig, VectorConfig
from scenarionet_sim.environments.flat import FlatEnv, FlatState
from scenarionet_sim.evaluation.specification import describe_database
from scenarionet_sim.learning.config import LearnerConfig, describe_config, make_learner_config
from scenarionet_sim.learning.experts import Experts
from scenarionet_sim.learning.learners import make_learner
from scenarionet_sim.learning.testing import drive_each
from scenarionet_sim.policies.external import External
from scenarionet_sim.policies.idm import Idm
from scenarionet_sim.policies.objects import other_vehicles
from scenarionet_sim.policies.replay import Replay
from scenarionet_sim.policies.route_sight import Guidance
from scenarionet_sim.scenarios.sampling import Curriculum
from scenarionet_sim.scenarios.selection import Scenarios, resolved
from scenarionet_sim.task.task import TASKS

_KEPT_WORLDS = 256
"""Largest number of scenarios to keep in memory."""

KEPT_CHECKPOINTS = 2
"""Checkpoints of a run that stay on disk."""

OnRound = Callable[[Mapping[str, Any]], None]


@dataclass(frozen=True)
class Training:
    """Specification of a training run; picklable.

    Attributes:
        lake: Path or URL of the lake.
        database: ``name@version``, scenario ids, or None for the whole lake.
        snapshot: Number of the lake's snapshot.
        algorithm: A name in ``config.ALGORITHMS``, or ``module:Class``.
        config: Settings.
        seed: Seed of weights, actions, minibatches and scenarios.
        tests: Databases on which the policy is tested at each checkpoint.
        observations: Run of ``scenarionet runs record`` with the experts' observations, for imitation.
    """

    lake: str
    database: str | tuple[str, ...] | None
    snapshot: int
    algorithm: str
    config: LearnerConfig
    seed: int = 0
    tests: tuple[str, ...] = ()
    observations: str | None = None

    @property
    def description(self) -> dict[str, Any]:
        """Everything that the weights depend on, as stored with the run."""
        return {
            "database": describe_database(self.database),
            "snapshot": self.snapshot,
            "algorithm": self.algorithm,
            "config": describe_config(self.config),
            "observation": self.config.observation,
            "seed": self.seed,
            "tests": list(self.tests),
            "observations": self.observations,
            "software": version.name_and_version(),
        }

    @property
    def default_name(self) -> str:
        """Name of the run unless one is given."""
        words = [describe_database(self.database) or "all", self.algorithm, f"seed{self.seed}"]
        return "-".join(words).replace("@", ".").replace(":", ".")

    def environment(self, database: str | tuple[str, ...] | None = None, *, is_test: bool = False) -> EnvConfig:
        """Return the environment of training, or of a test on another database."""
        config = self.config
        curriculum = Curriculum(config.levels, config.promotion) if config.levels and not is_test else None
        scenarios = Scenarios(
            self.lake,
            database if is_test else self.database,
            order="sequential" if is_test or curriculum else "random",
            curriculum=curriculum,
            snapshot=self.snapshot,
        )
        teacher = (Guidance(),) if config.is_guided and not is_test else ()
        sensors = (*OBSERVATIONS[config.observation], *teacher)
        if config.seats > 1:
            return MultiAgentConfig(scenarios, sensors=sensors, cache_size=_KEPT_WORLDS)
        others = (Replay(), Idm(objects=other_vehicles)) if config.traffic == "idm" else (Replay(),)
        reward, termination = TASKS[config.task]
        return VectorConfig(
            scenarios, policies=(*others, External()), sensors=sensors, reward=reward, termination=termination,
            cache_size=_KEPT_WORLDS,
        )  # fmt: skip


@dataclass
class TrainingReport:
    """Result of a call of :func:`train`.

    Attributes:
        run: Name of the run.
        steps: Steps of agents of the whole run.
        resumed: Steps that earlier calls had done.
        last: Metrics of the last round; empty if none was left to do.
        tests: Metrics of the last checkpoint by test database.
        skipped: Scenarios that could not be read and were left out, with the reason.
        seconds: Wall time of this call.
        times: Its parts by activity: environment, inference, update.
        memory: Bytes of the experience in memory.
        disk: Largest number of bytes of the checkpoints on disk.
    """

    run: str
    steps: int = 0
    resumed: int = 0
    last: dict[str, Any] = field(default_factory=dict)
    tests: dict[str, dict[str, Any]] = field(default_factory=dict)
    skipped: dict[str, str] = field(default_factory=dict)
    seconds: float = 0.0
    times: dict[str, float] = field(default_factory=dict)
    memory: int = 0
    disk: int = 0

    @property
    def speed(self) -> float:
        """Steps of agents per second of this call, without tests and checkpoints."""
        return (self.steps - self.resumed) / (sum(self.times.values()) or 1.0)


def train(
    lake: Lake | str | Path,
    database: Database | str | Sequence[str] | None = None,
    *,
    algorithm: str,
    config: LearnerConfig | None = None,
    seed: int = 0,
    name: str | None = None,
    tests: Sequence[str] = (),
    observations: str | None = None,
    on_round: OnRound | None = None,
) -> TrainingReport:
    """Train a driver and write its metrics and checkpoints into the lake.

    A second call with the same arguments continues an interrupted run from its newest checkpoint, on the snapshot that
    it began with.

    Args:
        lake: The lake, its path or its URL.
        database: Training scenarios: a ``Database``, its name, scenario ids, or None for the whole lake.
        algorithm: ``ppo``, ``td3``, ``ippo``, ``copo``, ``gail``, ``airl``, ``dagger``, or ``module:Class``.
        config: Settings; None for the published ones.
        seed: Seed of weights, actions, minibatches and scenarios.
        name: Name of the run; None for database, algorithm and seed joined by hyphens.
        tests: Databases on which the policy is tested at each checkpoint.
        observations: Run of :func:`scenarionet_sim.record` with the experts' observations, for ``gail`` and ``airl``.
        on_round: Called with the metrics of each round.

    Raises:
        DatabaseNotFound: A database does not exist.
        BadParameter: A setting is unknown or does not fit the scenarios, or a run of that name has other settings.
        LakeError: No scenario can be read, a reward or loss is not a number, or another process trains this run;
            checkpoints are kept.
    """
    training = plan_training(
        lake, database, algorithm, config=config, seed=seed, tests=tests, observations=observations, name=name
    )
    return run_training(training, name, on_round)


def plan_training(
    lake: Lake | str | Path,
    database: Database | str | Sequence[str] | None,
    algorithm: str,
    *,
    config: LearnerConfig | None = None,
    seed: int = 0,
    tests: Sequence[str] = (),
    observations: str | None = None,
    name: str | None = None,
) -> Training:
    """Return the specification of a run; arguments and errors as in :func:`train`."""
    lake, reference = resolved(lake, database)
    known = tuple(lake.database(test).reference for test in tests)
    config = config or make_learner_config(algorithm)
    number = lake.snapshot.number
    training = Training(str(lake.root), reference, number, algorithm, config, seed, known, observations)
    begun = evaluation_runs.begun_at(lake.files, name or training.default_name)
    return training if begun is None else replace(training, snapshot=begun)


def run_training(training: Training, name: str | None = None, on_round: OnRound | None = None) -> TrainingReport:
    """Train from the newest checkpoint to the end; arguments and errors as in :func:`train`."""
    torch.set_num_threads(1)
    files, name, config = open_files(training.lake), name or training.default_name, training.config
    env = FlatEnv(config.worlds, training.environment(), config.seats, training.seed, threads=1, keeps_past=True)
    with closing(env):
        run = evaluation_runs.claim(files, name, ("training",), training.description)  # settings fit the scenarios
        with checkpoints.only_process(files, name):
            return _train(training, run, env, on_round)


def _train(training: Training, run: EvaluationRun, env: FlatEnv, on_round: OnRound | None) -> TrainingReport:
    began, files, name = monotonic(), run.files, run.name
    config, report = training.config, TrainingReport(name)
    checkpoint = checkpoints.load(files, name)
    if checkpoint is not None and checkpoint.facts["steps"] >= config.steps:
        return TrainingReport(name, checkpoint.facts["steps"], checkpoint.facts["steps"])
    if checkpoint is None:
        env.reset(training.seed)
        rounds = number = steps = 0
    else:
        arrays, facts = checkpoint.arrays, checkpoint.facts
        env.restore(FlatState(facts["series"], arrays["ages"], arrays["past"], arrays["observations"]))
        rounds, steps, number = facts["rounds"], facts["steps"], checkpoint.number
    experts = Experts.recorded(training.lake, training.observations) if training.observations else None
    learner = make_learner(env, config, training.seed, experts)
    if checkpoint is not None:
        learner.restore({key: torch.from_numpy(value.copy()) for key, value in checkpoint.arrays.items()})
    report.resumed, report.memory = steps, learner.num_bytes
    rows: list[dict[str, Any]] = []
    _, selected = Lake(training.lake, training.snapshot).find(training.database)
    columns = selected.columns(["scenario_id", "difficulty"])  # no data frame: Polars takes a gigabyte of addresses
    difficulty = dict(zip(columns["scenario_id"].to_pylist(), columns["difficulty"].to_pylist(), strict=True))
    seats = {test: _seats(training, test) for test in training.tests}
    while steps < config.steps:
        done, learned = learner.round()
        if not all(np.isfinite(value) for value in learned.values()):
            wrong = next(key for key, value in learned.items() if not np.isfinite(value))
            raise LakeError(
                f"run {name}: {wrong} is {learned[wrong]} after {steps:,} steps, expected a number; train again under "
                "another name with a smaller rate, checkpoints are kept"
            )
        rounds, steps = rounds + 1, steps + done
        report.times = {key: report.times.get(key, 0.0) + spent for key, spent in learner.clock.seconds.items()}
        seconds = {f"{activity}_seconds": spent for activity, spent in learner.clock.seconds.items()}
        learner.clock.seconds = {}
        driven = [difficulty[env.scenario_id(row)] for row in range(0, env.num_agents, env.seats)]
        known = [value for value in driven if value is not None]
        place = {"round": rounds, "steps": steps, "level": env.level, "coverage": env.coverage}
        place["difficulty"] = sum(known) / len(known) if known else None
        rows.append(place | learner.outcomes.take() | seconds | {"learned": json.dumps(dict(learned))})
        if on_round is not None:
            on_round(rows[-1])
        if rounds % config.checkpoint_every == 0 or steps >= config.steps:
            report.last, number = rows[-1], number + 1
            for test in training.tests:  # without exploration
                environment = training.environment(test, is_test=True)
                means = drive_each(environment, learner.mode, config.worlds, seats[test]).take()
                report.tests[test] = {"test": test, "round": rounds, "steps": steps} | means
            checkpoints.check_free(files, name, number)
            run.publish(number, {"training": rows + list(report.tests.values())})
            state, arrays = env.state(), {key: value.numpy() for key, value in learner.tensors().items()}
            arrays |= {"ages": state.ages, "past": state.actions, "observations": state.observations}
            facts = {"rounds": rounds, "steps": steps, "series": state.series}
            size = checkpoints.save(files, name, checkpoints.Checkpoint(number, facts, arrays), KEPT_CHECKPOINTS)
            report.disk = max(report.disk, (KEPT_CHECKPOINTS + 1) * size)
            rows = []
    report.skipped = {scenario_id: reason for scenario_id, (reason, _) in env.skipped.items()}
    report.steps, report.seconds = steps, monotonic() - began
    return report


def _seats(training: Training, test: str) -> int:
    """Return how many seats a world of a test needs, so that every agent has one."""
    if training.config.seats == 1:
        return 1
    _, found = Lake(training.lake, training.snapshot).find(test)
    return int(max(found.columns(["num_vehicles"])["num_vehicles"].to_pylist()))
