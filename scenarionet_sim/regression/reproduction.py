"""A folder that shows failures again: their smallest scenarios as a pack, a test for pytest, files for other tools."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from scenarionet_data import Lake, ScenarioDescription, ScenarioLoader
from scenarionet_data.errors import BadParameter, InvalidScenario, MissingDependency
from scenarionet_data.execution.executors import Done, Work, executor_for
from scenarionet_data.export import export
from scenarionet_data.ingest.options import Options
from scenarionet_data.ingest.shard import RawItem, Shard
from scenarionet_data.scenario.description import make_scenario_id
from scenarionet_data.storage.files.places import open_files
from scenarionet_data.storage.snapshots import commit as commits
from scenarionet_data.storage.write.shard_writer import ShardWriter
from scenarionet_sim.drivers.code import interpreter_of
from scenarionet_sim.drivers.own_process import executor_of
from scenarionet_sim.evaluation.evaluation import plan_evaluation, run_evaluation
from scenarionet_sim.evaluation.specification import Evaluation
from scenarionet_sim.regression.failures import severity
from scenarionet_sim.regression.reduction import ReductionJob, drive_stored, reduce_failure, smallest_passing
from scenarionet_sim.rollouts.driven import DrivenScenarios

DATASET, DATABASE, PACK, INDEX, TEST = "reproduction", "failures", "pack", "failures.json", "test_failures.py"
CONDITIONS = ("traffic", "backend", "seed", "episode", "tracker", "route")

_TEXT = '''"""What a policy failed that the one before did not; written by scenarionet runs regress.

POLICY names the policy to test: POLICY=git:main:my_planner:MyPlanner pytest test_failures.py
"""

import json
import os
from pathlib import Path

import pytest

from scenarionet_sim import drive_again

HERE = Path(__file__).parent
POLICY = os.environ.get("POLICY", {policy!r})


@pytest.mark.parametrize("scenario_id", json.loads((HERE / "{index}").read_text("utf-8"))["failures"])
def test_it_does_not_fail_as_before(scenario_id):
    failure = drive_again(HERE, scenario_id, POLICY)
    assert not failure.is_as_bad, failure
'''


@dataclass(frozen=True)
class Reproduction:
    """The smallest scenario of a failure.

    Attributes:
        scenario_id, parent: In the pack, and whole.
        kind: See :func:`~scenarionet_sim.regression.failures.failure_kind`.
        road_users: Number beside the ego.
        seconds: Its length.
        is_exact: Whether it fails again from the pack with the same trajectories, bit by bit.
    """

    scenario_id: str
    parent: str
    kind: str
    road_users: int
    seconds: float
    is_exact: bool


@dataclass(frozen=True)
class DrivenAgain:
    """How a policy drives through a reproduction.

    Attributes:
        kind, before: What goes wrong now, empty if nothing; and what went wrong.
        is_as_bad: Whether that is as bad.
        is_exact: Whether it is the same drive, bit by bit.
    """

    kind: str
    before: str
    is_as_bad: bool
    is_exact: bool


def write_reproductions(
    old: Evaluation, new: Evaluation, ids: Sequence[str], folder: Path, *, workers: int = 1
) -> tuple[list[Reproduction], list[str]]:
    """Reduce failures and write them to a new folder.

    Args:
        old, new: Evaluations of both policies.
        ids: Scenarios that the new one fails, and the old one less badly or not.
        folder: Must not exist.
        workers: Number of processes.

    Returns:
        What is in the folder, and why a format is missing.

    Raises:
        BadParameter: The folder exists.
    """
    if folder.exists():
        raise BadParameter(f"{folder}: exists; choose another folder, or remove it first")
    reduced = _run(new, [ReductionJob(new, each) for each in ids], reduce_failure, workers)
    reductions = {each.scenarios[0].id: each for each in reduced if each is not None}
    if not reductions:
        return [], []
    numbers = dict(_run(old, [(old, each) for each in reductions.values()], smallest_passing, workers))
    chosen = []
    for name, number in sorted(numbers.items()):
        scenario = reductions[name].scenarios[number].with_own_map()
        scenario = replace(
            scenario, id=make_scenario_id(DATASET, "v", name), dataset=DATASET, version="v", split="test",
            extras={**scenario.extras, "parent": name},
        )  # fmt: skip
        chosen.append((scenario, reductions[name].failures[number]))
    folder.mkdir(parents=True)
    with tempfile.TemporaryDirectory(dir=folder, prefix=".") as draft:
        lake = _write_lake(Path(draft, "lake"), [scenario for scenario, _ in chosen])
        lake.pack(DATABASE, folder / PACK)
        notes = _export(lake, new, folder)
    failures = {
        scenario.id: {"parent": scenario.extras["parent"], "kind": failure.kind, "digest": failure.digest}
        for scenario, failure in chosen
    }
    conditions = {name: getattr(new, name) for name in CONDITIONS}
    index = {"policy": new.policy, "conditions": conditions, "failures": failures}
    (folder / INDEX).write_text(json.dumps(index, indent=1) + "\n", "utf-8")
    (folder / TEST).write_text(_TEXT.format(policy=new.policy, index=INDEX), "utf-8")
    here = replace(_planned(folder, new.policy, new.python, conditions), code=new.code)
    again = dict(_run(here, [ReductionJob(here, each) for each in failures], drive_stored, workers))
    return [
        Reproduction(
            scenario.id, scenario.extras["parent"], failure.kind, len(scenario.tracks) - 1,
            float(scenario.timestamps[-1]), again[scenario.id].digest == failure.digest,
        )
        for scenario, failure in chosen
    ], notes  # fmt: skip


def drive_again(folder: str | Path, scenario_id: str, policy: str, python: str = "") -> DrivenAgain:
    """Drive a policy through a reproduction, as the test in its folder does.

    Args:
        folder: What ``scenarionet runs regress -o`` has written.
        scenario_id: A scenario of its pack.
        policy, python: See :func:`scenarionet_sim.evaluate`.

    Raises:
        BadParameter: There is no such reproduction, or the policy cannot be imported.
    """
    try:
        index = json.loads(Path(folder, INDEX).read_text("utf-8"))
        before, conditions = index["failures"][scenario_id], index["conditions"]
    except (OSError, ValueError, KeyError) as error:
        raise BadParameter(
            f"{folder}: no reproduction of {scenario_id} ({error!r}); write it by runs regress -o"
        ) from error
    evaluation = _planned(Path(folder), policy, interpreter_of(policy, python), conditions)
    ((_, found),) = _run(evaluation, [ReductionJob(evaluation, scenario_id)], drive_stored, 1)
    is_as_bad = severity(found.kind) >= severity(before["kind"])
    return DrivenAgain(found.kind, before["kind"], is_as_bad, found.digest == before["digest"])


def _run(evaluation: Evaluation, jobs: Sequence[Work], do: Callable[[Work], Done], workers: int) -> list[Done]:
    """Results of jobs in the process of a policy, in order of completion."""
    executor = executor_of(evaluation.policy, evaluation.python, workers) or executor_for(workers, len(jobs))
    return list(executor(jobs, do))


def _planned(folder: Path, policy: str, python: str, conditions: Mapping[str, Any]) -> Evaluation:
    return plan_evaluation(folder / PACK, DATABASE, policy, python=python, **conditions)


def _write_lake(root: Path, scenarios: Sequence[ScenarioDescription]) -> Lake:
    """The scenarios as a lake, with a database of all of them."""
    licences = {scenario.source.licence for scenario in scenarios}
    shard = Shard(DATASET, "v", "test", DATABASE, "", (RawItem(DATABASE, ""),), Options())
    writer = ShardWriter(open_files(root), shard, "1", ", ".join(sorted(licences)))
    for scenario in scenarios:
        writer.add(scenario)
    commits.commit(open_files(root), [writer.finish()], "regress")
    lake = Lake(root)
    lake.filter("true", name=DATABASE)
    return lake


def _export(lake: Lake, new: Evaluation, folder: Path) -> list[str]:
    """Write OpenSCENARIO files, and for rerun what the policy does; return why one is missing."""
    loader, notes = ScenarioLoader(lake, DATABASE), []
    here = replace(new, lake=str(lake.root), database=f"{DATABASE}@1", snapshot=lake.snapshot.number, rollouts=1)
    run_evaluation(here, "new")
    driven = DrivenScenarios(loader, str(lake.root), "new", beside=True)
    for name, scenarios in (("openscenario", loader), ("rerun", driven)):
        try:
            export(scenarios, folder / name, file_format=name)
        except (MissingDependency, InvalidScenario) as error:
            notes.append(f"no files for {name}: {error}")
    return notes
