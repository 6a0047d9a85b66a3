"""The examples run."""

from __future__ import annotations

import gymnasium
import idm_ego
import pytest
import random_agent
from click.testing import CliRunner

import scenarionet_sim
from scenarionet_data.conversion import convert
from scenarionet_sim.scenarios.selection import Scenarios

pytestmark = pytest.mark.integration


@pytest.fixture(scope="module")
def generated(tmp_path_factory):
    lake = tmp_path_factory.mktemp("generated") / "lake"
    convert("pg", "0:12", lake)
    return str(lake)


@pytest.mark.parametrize(
    ("program", "arguments", "printed"),
    [
        (random_agent.main, ["--episodes", "2"], "pg/v2/0"),
        (idm_ego.main, [], "of 12"),
    ],
)
def test_programs(generated, program, arguments, printed):
    done = CliRunner().invoke(program, [generated, *arguments], catch_exceptions=False)
    assert done.exit_code == 0 and printed in done.output
    assert CliRunner().invoke(program, ["--help"]).output


def test_random_agent_is_reproducible(generated):
    env = gymnasium.make("ScenarioNet-v0", scenarios=Scenarios(generated))
    assert scenarionet_sim and random_agent.play(env, 2, seed=3) == random_agent.play(env, 2, seed=3)


def test_idm_ego_arrives(generated):
    ends = idm_ego.evaluate(Scenarios(generated))
    assert ends["episodes"] == 12 and ends["out_of_road"] == 0
    assert ends["success"] >= 9
