"""Real recordings, if available: all replay to success, and run with several agents."""

from __future__ import annotations

import numpy as np
import pytest

from scenarionet_data import Lake
from scenarionet_data.conversion import convert
from scenarionet_data.converters.argoverse1 import Argoverse1Options
from scenarionet_data.converters.lyft import LyftOptions
from scenarionet_sim import evaluate
from scenarionet_sim.backends.bullet import Bullet
from scenarionet_sim.backends.kinematic import Kinematic
from scenarionet_sim.environments.multi_agent import ScenarioNetParallelEnv
from scenarionet_sim.environments.single_agent import ScenarioNetEnv
from scenarionet_sim.policies.replay import Replay
from scenarionet_sim.scenarios.selection import Scenarios

SOURCES = [
    ("scenarionet", "scenarionet", None),
    ("waymo", "waymo/training", None),
    ("argoverse2", "argoverse2/motion-forecasting/val", None),
    ("argoverse2", "argoverse2/sensor/val", None),
    ("argoverse1", "argoverse1/forecasting/train", Argoverse1Options(has_map=False)),
    ("lyft", "lyft/scenes/sample.zarr", LyftOptions(has_map=False)),
]
"""Dataset, folder below the recordings, options: without a map where the map data are missing."""


@pytest.mark.long
def test_every_recording_of_every_source_replays_to_success(recordings, tmp_path):
    for dataset, folder, options in SOURCES:
        convert(dataset, str(recordings / folder), tmp_path, options=options)
    lake = Lake(tmp_path)
    for backend in ("kinematic", "bullet"):
        report = evaluate(lake, policy="replay", backend=backend, name=backend, rollouts=False)
        assert report.broken == [] and report.scenarios == len(lake) >= 59
    ends = Lake(tmp_path).sql("SELECT run, success, max(average_displacement) AS off FROM results GROUP BY ALL")
    assert ends["success"].to_list() == [True, True]
    assert ends["off"].max() < 1e-5


@pytest.fixture(scope="module")
def pickled(recordings, tmp_path_factory):
    lake = tmp_path_factory.mktemp("recorded") / "lake"
    convert("scenarionet", str(recordings / "scenarionet"), lake)
    return Scenarios(lake)


@pytest.mark.integration
@pytest.mark.parametrize("backend", [Kinematic(), Bullet()], ids=["kinematic", "bullet"])
def test_every_recording_replays_to_success(pickled, backend):
    env = ScenarioNetEnv(scenarios=pickled, policies=(Replay(),), backend=backend)
    for _ in range(len(env)):
        env.reset()
        is_over = False
        while not is_over:
            _, _, terminated, truncated, info = env.step((0.0, 0.0))
            assert info["distance_to_log"] < 1e-5
            is_over = terminated or truncated
        assert info["success"], info["scenario_id"]


@pytest.mark.parametrize(
    "backend", [Kinematic(), pytest.param(Bullet(), marks=pytest.mark.integration)], ids=["kinematic", "bullet"]
)
def test_every_vehicle_of_a_recording_is_an_agent(pickled, backend):
    env, most = ScenarioNetParallelEnv(scenarios=pickled, backend=backend), 0
    for _ in range(14):
        env.reset()
        most = max(most, len(env.agents))
        for _ in range(10):
            if env.agents:
                _, rewards, *_ = env.step(dict.fromkeys(env.agents, (0.0, 0.05)))
                assert np.isfinite(list(rewards.values())).all()
    assert most >= 20
