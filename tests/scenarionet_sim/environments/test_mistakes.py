"""Plausible mistakes with environments, cameras and simulations end in a sentence that says what was expected."""

from __future__ import annotations

import inspect
import math
from dataclasses import fields

import numpy as np
import pytest

from scenarionet_data.errors import BadParameter
from scenarionet_sim import (
    Camera,
    EgoState,
    Idm,
    Lidar,
    ScenarioNetEnv,
    ScenarioNetParallelEnv,
    ScenarioNetVectorEnv,
    Simulation,
    World,
)
from scenarionet_sim.environments.config import EnvConfig, MultiAgentConfig, VectorConfig


@pytest.fixture
def env(only):
    return ScenarioNetEnv(scenarios=only("crowd"))


@pytest.mark.parametrize(
    ("setting", "value"),
    [
        ("sensors", "camera"),
        ("sensors", ["lidar"]),
        ("sensors", Camera),
        ("sensors", (Lidar,)),
        ("sensors", ()),
        ("policies", "idm"),
        ("policies", ("replay",)),
        ("policies", (Idm,)),
        ("backend", "bullet"),
        ("reward", {"speed": 1.0}),
        ("termination", None),
        ("dt", "a"),
        ("dt", math.inf),
        ("prefetch", 1.5),
        ("prefetch", -1),
        ("cache_size", 0),
    ],
)
def test_settings(only, setting, value):
    with pytest.raises(BadParameter, match=rf"{setting}.*(expected|needs)|expected.*{setting}"):
        ScenarioNetEnv(scenarios=only("crowd"), **{setting: value})


def test_one_sensor_needs_no_tuple(only):
    env = ScenarioNetEnv(scenarios=only("crowd"), sensors=EgoState())
    assert env.config.sensors == (EgoState(),)
    assert env.reset(seed=0)[0].shape == EgoState().shape


def test_scenarios_in_the_place_of_the_configuration(only):
    with pytest.raises(BadParameter, match="expected a EnvConfig; pass scenarios="):
        ScenarioNetEnv(only("crowd"))


@pytest.mark.parametrize(
    "options",
    [{"scenario": "pg/v1/3"}, "pg/v1/3", {"timestep": "a"}, {"timestep": 1.5}, {"timestep": -1}, ["timestep"]],
)
def test_reset_options(only, env, options):
    with pytest.raises(BadParameter, match=r"(expected|choose)"):
        env.reset(options=options)
    with pytest.raises(BadParameter, match=r"(expected|choose)"):
        ScenarioNetParallelEnv(scenarios=only("crowd")).reset(options=options)


@pytest.mark.parametrize("seed", [-1, 1.5, "a"])
def test_seeds(only, env, seed):
    with pytest.raises(BadParameter, match=r"seed=.* expected a whole number"):
        env.reset(seed=seed)
    with pytest.raises(BadParameter, match=r"seed=.* expected a whole number"):
        ScenarioNetVectorEnv(num_envs=1, scenarios=only("crowd"), seed=seed).reset()


@pytest.mark.parametrize("action", [None, "left", 3, ["a", "b"], [math.nan, 0.0], [math.inf, 0.0], [[0.0, 1.0], 2.0]])
def test_actions(env, action):
    env.reset(seed=0)
    with pytest.raises(BadParameter, match="action"):
        env.step(action)


@pytest.mark.parametrize("action", [[0.0], ["a", "b"], "left"])
def test_actions_of_many_agents(only, action):
    env = ScenarioNetParallelEnv(scenarios=only("crowd"))
    env.reset(seed=0)
    with pytest.raises(BadParameter, match="actions"):
        env.step([action])
    with pytest.raises(BadParameter, match="actions"):
        env.step(dict.fromkeys(env.agents, action))


@pytest.mark.parametrize("counts", [{"num_envs": 0}, {"num_envs": 1.5}, {"threads": -1}, {"threads": "a"}])
def test_counts_of_a_batch(only, counts):
    with pytest.raises(BadParameter, match=rf"{next(iter(counts))}=.* expected"):
        ScenarioNetVectorEnv(**{"num_envs": 2, "scenarios": only("crowd"), **counts})


@pytest.mark.parametrize(
    "options",
    [
        {"width": 1.5},
        {"height": "84"},
        {"width": 0},
        {"channels": "rgb"},
        {"channels": ("colour",)},
        {"channels": ()},
        {"fov": 120},
        {"fov": "wide"},
        {"mount": (1.2, 0.0, 1.5)},
        {"weather": "rain"},
        {"range": math.inf},
        {"threads": 0},
        {"device": "gpu"},
    ],
)
def test_cameras(options):
    with pytest.raises(BadParameter, match=next(iter(options)) if "width" not in options else "width|pixels"):
        Camera(**options)


@pytest.mark.parametrize("options", [{"rays": 1.5}, {"rays": -1}, {"range": math.inf}, {"range": math.nan}])
def test_rays(options):
    with pytest.raises(BadParameter, match=next(iter(options))):
        Lidar(**options)


def test_simulations(only):
    loader, _ = only("crowd").open()
    world = World.from_scenario(loader[0])
    for worlds in (world, [], [loader[0]], None):
        with pytest.raises(BadParameter, match=r"worlds=.* expected one or more"):
            Simulation(worlds)
    with pytest.raises(BadParameter, match=r"expected a scenario.*pg/v1/3"):
        World.from_scenario("pg/v1/3")


@pytest.mark.parametrize(
    ("environment", "config"),
    [(ScenarioNetEnv, EnvConfig), (ScenarioNetVectorEnv, VectorConfig), (ScenarioNetParallelEnv, MultiAgentConfig)],
)
def test_signature_shows_all_settings(environment, config):
    """To completion and ``help``."""
    shown = inspect.signature(environment).parameters
    assert {each.name for each in fields(config)} <= shown.keys()
    assert shown["sensors"].default == config.__dataclass_fields__["sensors"].default
    assert {"config", "seed", "render_mode"} <= shown.keys()
    assert "settings" not in shown


def test_settings_are_accepted_as_numpy_numbers(only):
    env = ScenarioNetEnv(scenarios=only("crowd"), sensors=Camera(np.int64(8), np.int32(6)), observation="dict")
    observed, _ = env.reset(seed=np.int64(3), options={"timestep": np.int32(0)})
    assert observed["camera"].shape == (6, 8, 3)
