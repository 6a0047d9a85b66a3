"""Comparisons of drivers: arms that are trained with several seeds and tested alike, and claims about them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from scenarionet_data import Lake
from scenarionet_data.errors import BadParameter
from scenarionet_data.execution.executors import Executor
from scenarionet_data.execution.progress import Progress
from scenarionet_sim.evaluation.intervals import Interval, mean_interval
from scenarionet_sim.learning.config import LearnerConfig
from scenarionet_sim.learning.experiments.statistics import CEILING, Verdict, has_flattened, holm, verdict
from scenarionet_sim.rollouts.parts import run_parts

METRICS = (
    "success", "out_of_road", "timeout", "crashed", "route_completion", "speed_ratio", "cost", "reward",
    "distance_to_log", "final_distance",
)  # fmt: skip
"""Columns of tables and curves: those of the table training, and the speed as a share of the recorded one."""


@dataclass(frozen=True)
class TrainingArm:
    """One way to train.

    Attributes:
        name: Its name in tables and figures.
        algorithm, config: How.
        database: Scenarios to train on.
        validation: Database whose success selects the checkpoint.
        observations: Run with the experts' observations, for imitation.
    """

    name: str
    algorithm: str
    config: LearnerConfig
    database: str
    validation: str
    observations: str | None = None


@dataclass(frozen=True)
class Claim:
    """A sentence of the paper as an inequality: ``metric`` on ``test`` is larger for ``better`` than for ``worse``.

    Attributes:
        text: The sentence.
        better, worse: Names of arms.
        test: Database.
        metric: Column of the table training.
    """

    text: str
    better: str
    worse: str
    test: str
    metric: str = "success"


@dataclass(frozen=True)
class PublishedFigure:
    """A number of the paper, shown beside ours.

    Attributes:
        arm, test, metric: Of our table.
        value: The paper's.
        place: Where it is in the paper.
    """

    arm: str
    test: str
    metric: str
    value: float
    place: str


@dataclass(frozen=True)
class EarlierResult:
    """What an earlier run of an experiment gave, with whatever configuration.

    Attributes:
        date, commit: When, and of which code.
        said: Its verdicts, and what was wrong with it.
    """

    date: str
    commit: str
    said: str


@dataclass(frozen=True)
class Comparison:
    """An experiment: its configuration is fixed before the first run.

    Attributes:
        name, size: Its name, and ``small`` or ``paper``.
        arms: What is compared.
        seeds: Of every arm.
        tests: Databases on which all are tested, with a title for each.
        claims: What the paper says.
        metrics: Columns of the table.
        sources: Databases whose statistics are shown.
        paper: How the paper did it, and what is known of its results.
        published: Results of the paper.
        published_sources: Statistics of the paper's scenarios by source, in the columns of ours.
        shared: Tests whose scenarios are the same for all seeds; of any other test, each seed has a database of its
            own, ``<test>_<seed>``, so that the spread over seeds is that of seeds and scenarios.
        earlier: All earlier runs.
    """

    name: str
    size: str
    arms: tuple[TrainingArm, ...]
    seeds: tuple[int, ...]
    tests: Mapping[str, str]
    claims: tuple[Claim, ...]
    metrics: tuple[str, ...] = METRICS
    sources: Mapping[str, str] = field(default_factory=dict)
    paper: str = ""
    published: tuple[PublishedFigure, ...] = ()
    published_sources: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    shared: tuple[str, ...] = ()
    earlier: tuple[EarlierResult, ...] = ()

    def tests_of(self, seed: int) -> dict[str, str]:
        """Return the databases on which a seed is tested, with the name of the test of each."""
        return {name if name in self.shared else f"{name}_{seed}": name for name in self.tests}

    def run_name(self, arm: TrainingArm, seed: int) -> str:
        """Return the name of a run in the lake."""
        words = f"{self.name}-{self.size}-{arm.name}-seed{seed}".replace(" ", "-").replace("+", "and")
        return words.replace(",", "")


@dataclass(frozen=True)
class _ArmJob:
    lake: str
    name: str
    arm: TrainingArm
    seed: int
    tests: tuple[str, ...]


def run_comparison(
    lake: Lake | str | Path,
    comparison: Comparison,
    *,
    workers: int = 1,
    executor: Executor | None = None,
    on_progress: Progress | None = None,
) -> None:
    """Train every arm with every seed; runs that are complete are kept, others continue.

    Args:
        lake: The lake, its path or its URL.
        comparison: The experiment.
        workers: Number of processes.
        executor: Runs the trainings instead of local processes, for example on a cluster.
        on_progress: Called after each training.

    Raises:
        WorkerLost: A training kills its worker also when it runs alone.
    """
    root = str(lake.root) if isinstance(lake, Lake) else str(lake)
    jobs = [
        _ArmJob(
            root,
            comparison.run_name(arm, seed),
            arm,
            seed,
            tuple(dict.fromkeys([arm.validation, *comparison.tests_of(seed)])),
        )
        for seed in comparison.seeds
        for arm in comparison.arms
    ]
    for _ in run_parts(jobs, train_job, workers, on_progress, executor):
        pass


def train_job(job: _ArmJob) -> list[str]:
    """Train one arm with one seed; return the name of its run."""
    from scenarionet_sim.learning.training import train  # imports torch, in the worker

    arm = job.arm
    train(
        job.lake, arm.database, algorithm=arm.algorithm, config=arm.config, seed=job.seed, name=job.name,
        tests=job.tests, observations=arm.observations,
    )  # fmt: skip
    return [job.name]


@dataclass(frozen=True, eq=False)
class ComparisonResult:
    """What the runs of a comparison say.

    Attributes:
        curves: Rows of the table training of all runs, with columns arm and seed.
        chosen: One row per arm, seed and test, at the checkpoint with the best validation (the latest of equals).
    """

    curves: pl.DataFrame
    chosen: pl.DataFrame


def read_comparison(lake: Lake, comparison: Comparison) -> ComparisonResult:
    """Return the curves of all runs, and the tests at the chosen checkpoints.

    Raises:
        BadParameter: A run is missing or not complete, or arms were tested on different numbers of agents.
    """
    named = {comparison.run_name(arm, seed): (arm, seed) for seed in comparison.seeds for arm in comparison.arms}
    curves = lake.sql("SELECT * FROM training WHERE list_contains($names, run)", {"names": list(named)})
    missing = set(named) - set(curves.filter(pl.col("test").is_not_null())["run"])
    if missing:
        raise BadParameter(f"{comparison.name}: no tests of run {min(missing)}; run the experiment to its end")
    arms = {run: arm.name for run, (arm, _) in named.items()}
    seeds = {run: seed for run, (_, seed) in named.items()}
    curves = curves.with_columns(
        pl.col("run").replace_strict(arms).alias("arm"),
        pl.col("run").replace_strict(seeds).alias("seed"),
        pl.col("test").str.split("@").list.first().alias("database"),
    )
    tests = {database: test for seed in comparison.seeds for database, test in comparison.tests_of(seed).items()}
    tests |= {arm.validation: arm.validation for arm in comparison.arms}
    speeds = {name: _recorded_speed(lake, name, multi=comparison.arms[0].config.seats > 1) for name in tests}
    curves = curves.with_columns(
        pl.col("database").replace_strict(tests, default=None).alias("test"),
        (pl.col("speed") / pl.col("database").replace_strict(speeds, default=None)).alias("speed_ratio"),
    )
    tested = curves.filter(pl.col("test").is_in(list(comparison.tests)))
    for database, group in tested.partition_by("database", as_dict=True).items():
        counts = sorted(group["episodes"].unique().to_list())
        if len(counts) > 1:
            raise BadParameter(
                f"{comparison.name}: {counts[0]} to {counts[-1]} agents were tested on {database[0]}, expected as many "
                "of every arm; run the experiment again in another lake"
            )
    rows = []
    for run, (arm, _) in named.items():
        tested = curves.filter((pl.col("run") == run) & pl.col("test").is_not_null())
        valid = tested.filter(pl.col("database") == arm.validation).sort(["success", "round"])
        rows.append(tested.filter(pl.col("round") == valid["round"][-1]))
    return ComparisonResult(curves.sort(["arm", "seed", "round"]), pl.concat(rows))


def table(found: ComparisonResult, comparison: Comparison, test: str) -> dict[str, dict[str, Interval]]:
    """Return the interval over seeds of each metric by arm."""
    rows = found.chosen.filter(pl.col("test") == test)
    return {
        arm.name: {name: mean_interval(_by_seed(rows, arm.name, name)) for name in comparison.metrics}
        for arm in comparison.arms
    }


def judge_all(found: ComparisonResult, claims: Sequence[Claim]) -> list[tuple[Verdict, Interval, str]]:
    """Return the verdict about each claim of a page, the paired difference, and why.

    Of m claims the clearest is judged with an error of 5 %/m, the next with 5 %/(m - 1), up to the first whose interval
    has 0; all that are less clear have its error (Holm 1979), so that any wrong verdict has a probability below 5 %.
    """
    pairs = [_compared(found, claim) for claim in claims]
    levels = holm([better - worse for better, worse in pairs])
    return [judge(found, claim, level) for claim, level in zip(claims, levels, strict=True)]


def judge(found: ComparisonResult, claim: Claim, claims: int = 1) -> tuple[Verdict, Interval, str]:
    """Return the verdict about a claim with an error of 5 % / ``claims``, the paired difference, and why."""
    better, worse = _compared(found, claim)
    tested = found.curves.filter(pl.col("test") == claim.test)
    moving = [arm for arm in (claim.better, claim.worse) if not has_flattened(curve(tested, arm, claim.metric))]
    loss = pl.col("learned").str.json_path_match("$.discriminator_loss").cast(pl.Float64).alias("loss")
    judged = found.curves.filter(pl.col("database").is_null()).with_columns(loss).drop_nulls("loss")
    for arm in (claim.better, claim.worse):  # while the loss of its discriminator changes, so do its rewards
        if (judged["arm"] == arm).any() and not has_flattened(curve(judged, arm, "loss")):
            moving.append(f"{arm}'s discriminator")
    unlearned = [
        f"{arm}'s inverse dynamics has an error of {error:.0%} of the actions' variance"
        for arm in (claim.better, claim.worse)
        if (error := inverse_error(found, arm)) is not None and error >= 0.05
    ]
    said, interval = verdict(better - worse, are_flat=not moving and not unlearned, claims=claims)
    if claim.metric == "success" and min(better.mean(), worse.mean()) >= CEILING:
        return "inconclusive", interval, f"both succeed in {CEILING:.0%} or more: the test cannot tell"
    if not (better - worse).any():
        return said, interval, f"both have the same {claim.metric} with every seed: the test cannot tell"
    if moving:
        unlearned.insert(0, f"the curve of {' and of '.join(moving)} has not flattened")
    return said, interval, "; ".join(unlearned) or "all curves have flattened"


def inverse_error(found: ComparisonResult, arm: str) -> float | None:
    """Return the error of an arm's inverse dynamics over the last quarter of the rounds; None if it has none."""
    error = pl.col("learned").str.json_path_match("$.inverse_error").cast(pl.Float64).alias("error")
    rounds = found.curves.filter((pl.col("arm") == arm) & pl.col("database").is_null()).with_columns(error)
    last = rounds.drop_nulls("error").filter(pl.col("round") > 0.75 * pl.col("round").max())
    return float(np.mean(last["error"].to_numpy())) if len(last) else None


def curve(tested: pl.DataFrame, arm: str, metric: str) -> np.ndarray:
    """Return (seeds, checkpoints) of a metric on one test, up to the shortest of the runs."""
    runs = [rows.sort("steps")[metric].to_numpy() for _, rows in tested.filter(pl.col("arm") == arm).group_by("seed")]
    shortest = min(map(len, runs))
    return np.stack([values[:shortest] for values in runs])


def source_statistics(lake: Lake, sources: Mapping[str, str]) -> list[dict[str, Any]]:
    """Return what the scenarios of each source are like: speed, curvature and objects."""
    rows = []
    for title, name in sources.items():
        ids = lake.database(name).scenario_ids
        (row,) = lake.sql(
            """SELECT count(*) AS scenarios, avg(ego_mean_speed) AS speed, stddev(ego_mean_speed) AS speed_spread,
            avg(ego_distance) AS distance, avg(ego_cumulative_curvature / greatest(ego_distance, 1)) AS curvature,
            avg(num_vehicles) AS vehicles, avg(num_timesteps * dt) AS duration
            FROM metadata WHERE list_contains($ids, scenario_id)""",
            {"ids": list(ids)},
        ).to_dicts()
        rows.append({"source": title} | row)
    return rows


def _compared(found: ComparisonResult, claim: Claim) -> tuple[np.ndarray, np.ndarray]:
    """Return the metric of both arms of a claim by seed."""
    rows = found.chosen.filter(pl.col("test") == claim.test)
    return _by_seed(rows, claim.better, claim.metric), _by_seed(rows, claim.worse, claim.metric)


def _recorded_speed(lake: Lake, database: str, *, multi: bool) -> float:
    """Return the mean recorded speed [m/s] of the agents of a database: egos, or all vehicles that travel."""
    ids = {"ids": list(lake.database(database).scenario_ids)}
    if not multi:
        query = "SELECT avg(ego_mean_speed) AS speed FROM metadata WHERE list_contains($ids, scenario_id)"
        return float(lake.sql(query, ids)["speed"][0])
    query = """
        SELECT avg(speed) AS speed FROM (
            SELECT list_avg([sqrt(m[1] * m[1] + m[2] * m[2]) FOR m IN list_zip(vx, vy)]) AS speed,
            sqrt((x[-1] - x[1]) ** 2 + (y[-1] - y[1]) ** 2) AS distance
            FROM tracks WHERE object_type = 'VEHICLE' AND list_contains($ids, scenario_id)
        ) WHERE distance > 2.0"""
    return float(lake.sql(query, ids)["speed"][0])


def _by_seed(rows: pl.DataFrame, arm: str, metric: str) -> np.ndarray:
    return rows.filter(pl.col("arm") == arm).sort("seed")[metric].to_numpy()
