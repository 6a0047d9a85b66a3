"""Rollouts in a batch: the same tables, bit for bit, as one after another."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from scenarionet_data import Lake
from scenarionet_sim.backends.kinematic import Kinematic
from scenarionet_sim.drivers.by_name import resolve_drivers
from scenarionet_sim.evaluation import parts
from scenarionet_sim.evaluation.evaluation import evaluate
from scenarionet_sim.rollouts.batch import RolloutBatch, RolloutJob
from scenarionet_sim.rollouts.rollout import Rollout
from scenarionet_sim.sensors.lidar import Lidar
from scenarionet_sim.sensors.state import EgoState
from scenarionet_sim.worlds.world import World
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.lakes import write_lake

ODD = [
    make_drive("crowd", others=tuple(Other(12.0 + 9.0 * k, 3.5 * (k % 2), vx=3.0 + k) for k in range(6)), red=True),
    make_drive("alone", num_steps=12),
    make_drive("slow-clock", num_steps=9, dt=0.5, others=(Other(25.0, vx=2.0),)),
    make_drive("no-map", has_map=False, others=(Other(14.0, vx=1.0, first=3, last=20),)),
    make_drive("standing", speed=0.0, num_steps=30),
    make_drive("gap", hidden=slice(0, 6), num_steps=60, others=(Other(30.0, vx=6.0),)),
    make_drive("single-state", num_steps=2),
]


class Weaving:
    """Weaves from side to side, by what it remembers of its drive and sees through noise."""

    sensors = (EgoState(), Lidar(rays=12, noise=0.05))

    def reset(self) -> None:
        self.steps = 0

    def act(self, observation: np.ndarray) -> list[float]:
        self.steps += 1
        return [0.1 * np.sin(self.steps / 5.0), float(observation[7:].mean()) - 0.4]


class WeavingTogether:
    """Drives all egos at once."""

    sensors = (EgoState(),)
    largest = 0

    def act(self, observation: np.ndarray) -> np.ndarray:
        return self.act_batch(observation[None])[0]

    def act_batch(self, observations: np.ndarray) -> np.ndarray:
        type(self).largest = max(type(self).largest, len(observations))
        return np.stack([-observations[:, 4], 0.3 - observations[:, 0]], axis=1)


class Broken(Weaving):
    """Fails in fast drives."""

    def act(self, observation: np.ndarray) -> list[float]:
        if observation[0] > 0.2:
            raise ValueError("too fast")
        return super().act(observation)


def own(kind: type) -> str:
    return f"{__name__}:{kind.__name__}"


@pytest.fixture(scope="module")
def lake(tmp_path_factory) -> Lake:
    return write_lake(tmp_path_factory.mktemp("odd") / "lake", ODD)


def tables(lake: Lake, run: str) -> list[pl.DataFrame]:
    return [
        lake.sql(f"SELECT * EXCLUDE run FROM {table} WHERE run = $run ORDER BY ALL", {"run": run})
        for table in ("results", "rollouts")
    ]


EVALUATIONS = {
    "idm": {"policy": "idm", "traffic": "idm"},
    "seeds": {"policy": "constant-noisy", "traffic": "idm-sampled", "num_rollouts": 3, "seed": 5},
    "random": {"policy": "random", "backend": "kinematic", "num_rollouts": 2},
    "driver": {"policy": own(Weaving), "backend": "kinematic"},
    "together": {"policy": own(WeavingTogether), "backend": "kinematic"},
    "planner": {"policy": "pure-pursuit", "traffic": "idm-walking"},
    "lanes": {"policy": "idm-planner", "route": "lanes", "episode": "nuplan"},
    "fails": {"policy": own(Broken), "backend": "kinematic"},
}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name in ("idm", "driver") else pytest.mark.long) for name in EVALUATIONS]
)
def test_tables_of_a_batch_equal_those_of_one_world_after_another(lake, monkeypatch, name):
    for slots in (1, 3):
        monkeypatch.setattr(parts, "SLOTS", slots)
        evaluate(lake, **EVALUATIONS[name], name=f"{name}-{slots}")
    for one, several in zip(tables(lake, f"{name}-1"), tables(lake, f"{name}-3"), strict=True):
        assert len(one) and one.equals(several)
    errors = tables(lake, f"{name}-3")[0]["error"].drop_nulls().to_list()
    assert len(errors) == {"fails": 6, "lanes": 1}.get(name, 0), errors
    assert WeavingTogether.largest == (3 if name == "together" else WeavingTogether.largest)


def test_slots_are_filled_again_and_failures_stay_alone():
    world = World.from_scenario(ODD[1])
    jobs = [RolloutJob(number, world, num_steps=3 + number, waits=False) for number in range(5)]
    jobs[2] = replace(jobs[2], start=400)  # beyond the recording
    found = dict(RolloutBatch(resolve_drivers("replay"), Kinematic(), slots=2).run(jobs))
    lengths = {job.number: rollout.num_steps for job, rollout in found.items() if isinstance(rollout, Rollout)}
    assert lengths == {0: 3, 1: 4, 3: 6, 4: 7}
    assert "the ego is not valid at timestep 400" in str(found[jobs[2]])
