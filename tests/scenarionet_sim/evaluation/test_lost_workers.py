"""A killed worker process costs the rollouts in its hands, which run again; the tables are as without it."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import numpy as np
import pytest

from scenarionet_sim.evaluation import evaluation as evaluations
from scenarionet_sim.evaluation.evaluation import evaluate
from scenarionet_sim.sensors.state import EgoState
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.lakes import write_lake

SCENARIOS = [make_drive(f"d{k}", speed=6.0 + k, others=(Other(20.0 + 5 * k, vx=4.0),)) for k in range(6)]


class Careful:
    """Drives slowly."""

    sensors = (EgoState(),)

    def act(self, observation: np.ndarray) -> list[float]:
        return [0.0, 0.2 - float(observation[0])]


class Killed(Careful):
    """The same, in a process that is killed once while it drives the fourth scenario, or each time in the fifth."""

    def act(self, observation: np.ndarray) -> list[float]:
        speed, mark = round(40.0 * float(observation[0]), 3), Path(os.environ["SCENARIONET_TEST_KILLED"])
        if speed == 10.0 or (speed == 9.0 and not mark.exists()):
            mark.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return super().act(observation)


@pytest.mark.integration
def test_killed_worker_loses_its_rollouts_only(tmp_path, monkeypatch):
    monkeypatch.setenv("SCENARIONET_TEST_KILLED", str(tmp_path / "killed"))
    monkeypatch.setattr("scenarionet_sim.evaluation.specification.PART_SIZE", 1)
    evaluations.scenarios_of.cache_clear()
    lake = write_lake(tmp_path / "lake", SCENARIOS)
    policy = f"{__name__}:{{}}".format
    report = evaluate(lake, policy=policy("Killed"), backend="kinematic", name="killed", workers=2)
    assert (tmp_path / "killed").exists()
    ((lost, reason),) = report.broken
    assert lost == SCENARIOS[4].id and "killed" in reason
    evaluate(lake, policy=policy("Careful"), backend="kinematic", name="whole")
    for table in ("results", "rollouts"):
        killed, whole = (
            lake.sql(f"SELECT * EXCLUDE run FROM {table} WHERE run = $run AND scenario_id <> $lost ORDER BY ALL",
                     {"run": run, "lost": lost})
            for run in ("killed", "whole")
        )  # fmt: skip
        assert len(killed) and killed.equals(whole)
