"""Agents of CARLA's leaderboard, from a checkout, drive by the client's own classes in an environment of their own.

CARLA_LEADERBOARD is the checkout of carla-simulator/leaderboard; without it these tests are skipped.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest

from scenarionet_data import Lake
from scenarionet_data.errors import BadParameter
from scenarionet_sim.evaluation.evaluation import evaluate
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.lakes import write_lake

pytestmark = pytest.mark.interop

ROOT = Path(__file__).parents[2]
PYTHON = os.environ.get("CARLA_PYTHON", str(ROOT / ".venv-interop" / "tools" / "bin" / "python"))
FOLLOWER = f"carla:{ROOT / 'tests/interop/carla_follower.py'}:Follower"


@pytest.fixture
def leaderboard(monkeypatch: pytest.MonkeyPatch) -> Path:
    """Its checkout, in the import path of agents."""
    given = os.environ.get("CARLA_LEADERBOARD")
    if not given:
        pytest.skip("CARLA_LEADERBOARD, a checkout of CARLA's leaderboard, is not set: none of its agents is driven")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([given, str(ROOT), str(ROOT / "pipelines")]))
    return Path(given)


def driven(tmp_path: Path, policy: str, **options: Any) -> list[tuple[Any, ...]]:
    """Success and mean speed of an agent."""
    write_lake(tmp_path / "lake", [make_drive("lane", **options)])
    report = evaluate(tmp_path / "lake", policy=policy, python=PYTHON, name="agent")
    assert not report.broken
    return Lake(tmp_path / "lake").sql("SELECT success, mean_speed FROM results").rows()


def test_the_leaderboards_own_agent_gets_what_it_asks_for(leaderboard: Path, tmp_path: Path) -> None:
    """Three cameras, lidar, radar, GNSS, IMU and map; it never drives, so it rolls on."""
    policy = f"carla:{leaderboard / 'leaderboard/autoagents/dummy_agent.py'}:DummyAgent"
    ((_, speed),) = driven(tmp_path, policy, num_steps=4, speed=8.0, others=(Other(20.0),))
    assert speed == pytest.approx(8.0, abs=0.1)


def test_an_agent_drives_by_its_sensors_and_the_map_to_success(leaderboard: Path, tmp_path: Path) -> None:
    ((success, speed),) = driven(tmp_path, FOLLOWER, num_steps=61, speed=7.0)
    assert success
    assert speed == pytest.approx(7.0, abs=0.5)


def test_agents_that_ask_the_world_are_refused_in_a_sentence(
    leaderboard: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_lake(tmp_path / "lake", [make_drive("lane", num_steps=5)])
    npc = f"carla:{leaderboard / 'leaderboard/autoagents/npc_agent.py'}:NpcAgent"
    with pytest.raises(BadParameter, match="agents that drive by CARLA's world or its own agents are not driven here"):
        evaluate(tmp_path / "lake", policy=npc, python=PYTHON, name="npc")
    monkeypatch.setenv("TEAM_CONFIG", "world")
    ((_, error),) = evaluate(tmp_path / "lake", policy=FOLLOWER, python=PYTHON, name="asks").broken
    assert "the agent asks CARLA's world (Client.new), which is not there" in error


def test_without_the_client_it_says_so(tmp_path: Path) -> None:
    write_lake(tmp_path / "lake", [make_drive("lane", num_steps=5)])
    with pytest.raises(BadParameter, match=r"a requirements file with carla==0\.9\.16"):
        evaluate(tmp_path / "lake", policy=FOLLOWER, name="none")
