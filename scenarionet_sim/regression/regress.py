"""A regression test of a policy: the old and the new one on the same scenarios, and a verdict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path

from scenarionet_data import Database, Lake
from scenarionet_data.errors import BadParameter
from scenarionet_data.execution.progress import Progress
from scenarionet_data.scenario.settings import check_settings
from scenarionet_sim.drivers.code import interpreter_of
from scenarionet_sim.evaluation.evaluation import plan_evaluation
from scenarionet_sim.evaluation.specification import Evaluation, scenarios_of
from scenarionet_sim.regression.judgement import PRIMARY, Judgement, judge
from scenarionet_sim.regression.outcomes import KnownOutcomes, find_outcomes
from scenarionet_sim.regression.reproduction import Reproduction, write_reproductions


@dataclass(frozen=True)
class RegressionPlan:
    """What is compared, under which conditions, and what decides.

    Attributes:
        old, new: Policies, see :func:`scenarionet_sim.evaluate`.
        primary, margin, level: See :func:`~scenarionet_sim.regression.judgement.judge`; they are chosen before.
        old_python, new_python: Interpreters of other environments, or requirements files (``.txt``).
        traffic, backend, tracker, route, episode, seed, rollouts: See :func:`scenarionet_sim.evaluate`.
    """

    old: str
    new: str
    primary: str = PRIMARY
    margin: float = 0.02
    level: float = 0.05
    old_python: str = ""
    new_python: str = ""
    traffic: str = "replay"
    backend: str = "kinematic"
    tracker: str = "lqr"
    route: str = "log"
    episode: str = "log"
    seed: int = 0
    rollouts: int = 1

    def __post_init__(self) -> None:
        check_settings(self)

    def evaluation(self, lake: Lake, database: str | Sequence[str] | None, policy: str, python: str) -> Evaluation:
        """Return what is simulated with a policy; one of its own runs in a process of its own, which knows its code."""
        return plan_evaluation(
            lake, database if database is None or isinstance(database, str) else tuple(database), policy,
            traffic=self.traffic, backend=self.backend, seed=self.seed, num_rollouts=self.rollouts,
            episode=self.episode, tracker=self.tracker, route=self.route,
            python=interpreter_of(policy, python),
        )  # fmt: skip


@dataclass(frozen=True)
class RegressionReport:
    """What a regression test has found.

    Attributes:
        old, new: Where the results are.
        judgement: The verdict, and what the new policy fails.
        reproductions: The smallest scenarios of these failures, if a folder was given.
        notes: What could not be written there.
    """

    old: KnownOutcomes
    new: KnownOutcomes
    judgement: Judgement
    reproductions: tuple[Reproduction, ...] = ()
    notes: tuple[str, ...] = ()


def regress(
    lake: Lake | str | Path,
    database: Database | str | Sequence[str],
    plan: RegressionPlan,
    *,
    workers: int = 1,
    fresh: bool = False,
    folder: str | Path | None = None,
    most: int = 50,
    on_progress: Progress | None = None,
) -> RegressionReport:
    """Simulate an old and a new policy on the same scenarios with the same seeds, and judge the new one.

    What the lake has already of a deterministic policy is not simulated again.

    Args:
        lake: The lake, its path or its URL.
        database: A ``Database``, its name, or scenario ids.
        plan: What is compared.
        workers: Number of processes.
        fresh: Simulate everything again, also where the same code has driven the same scenario.
        folder: New folder for the smallest scenarios of new failures, with a test for pytest.
        most: Failures that are reduced, the worst of all kinds in turn.
        on_progress: Called after each finished part.

    Raises:
        BadParameter: The folder exists, a policy cannot be imported, there are no scenarios, or the deciding measure
            has no value.
        SourceNotFound: There is no such commit or file.
        DatabaseNotFound: The database does not exist.
    """
    if folder is not None and Path(folder).exists():
        raise BadParameter(f"{folder}: exists; choose another folder, or remove it first")
    opened = lake if isinstance(lake, Lake) else Lake(lake)
    if isinstance(database, Database):
        database = database.reference if database.is_saved else database.scenario_ids
    if not isinstance(plan, RegressionPlan):
        raise BadParameter(f"plan={plan!r}; expected RegressionPlan(old='git:main:mine:Mine', new='mine:Mine')")
    policies = ((plan.old, plan.old_python), (plan.new, plan.new_python))
    evaluations = [plan.evaluation(opened, database, *each) for each in policies]
    found = [find_outcomes(each, workers=workers, fresh=fresh, on_progress=on_progress) for each in evaluations]
    judgement = judge(
        Lake(opened.root), scenarios_of(evaluations[0]).scenario_ids, found[0].runs, found[1].runs,
        primary=plan.primary, margin=plan.margin, level=plan.level,
    )  # fmt: skip
    if folder is None or not judgement.clusters:
        return RegressionReport(found[0], found[1], judgement)
    if found[1].determinism != "deterministic":
        note = f"no failure is reduced: the new policy is {found[1].determinism}, and may not fail again"
        return RegressionReport(found[0], found[1], judgement, (), (note,))
    in_turn = zip_longest(*(cluster.failures for cluster in judgement.clusters))
    ids = [each.scenario_id for failures in in_turn for each in failures if each is not None][:most]
    old, new = evaluations
    reproductions, notes = write_reproductions(old, new, ids, Path(folder), workers=workers)
    return RegressionReport(found[0], found[1], judgement, tuple(reproductions), tuple(notes))
