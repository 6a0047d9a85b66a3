"""Imitation of a teacher: the loss by hand, who drives, and a network that learns what the teacher would do."""

from __future__ import annotations

import math
import shutil

import numpy as np
import pytest

pytestmark = pytest.mark.learn
torch = pytest.importorskip("torch", reason="no torch: run `make test-learn`")

from scenarionet_data import Lake  # noqa: E402
from scenarionet_data.storage.files.places import open_files  # noqa: E402
from scenarionet_sim.drivers.trained import TrainedDriver, load_driver  # noqa: E402
from scenarionet_sim.environments.config import ROUTE_OBSERVATION  # noqa: E402
from scenarionet_sim.environments.observation import Observation  # noqa: E402
from scenarionet_sim.learning.config import DaggerConfig  # noqa: E402
from scenarionet_sim.learning.dagger import DaggerLearner  # noqa: E402
from scenarionet_sim.learning.training import train  # noqa: E402
from scenarionet_sim.task.scoring_kernels import NUMBERS  # noqa: E402


class Wanted:
    """Rows that see two numbers, the second shifted and large, and a teacher that steers by 0.02 times the first."""

    num_agents = seats = 64

    def __init__(self):
        self._rng, self.driven = np.random.default_rng(0), []
        self.rewards, self.last_numbers = np.zeros(64, np.float32), np.zeros((64, len(NUMBERS)))
        self.terminals, self.truncations, self.arrivals = (np.zeros(64, np.bool_) for _ in range(3))
        self.masks = np.arange(64) < 60
        self._draw()

    def _draw(self):
        first, second = self._rng.normal(size=(2, 64))
        rows = np.stack([first, 100.0 + 10.0 * second, 0.02 * first, np.tanh(second)], axis=1)
        self.observations = np.where(self.masks[:, None], rows, 0.0).astype(np.float32)

    def step(self, actions):
        self.driven.append((np.array(actions), self.observations[:, 2:].copy()))
        self._draw()


def make(**settings):
    env = Wanted()
    return env, DaggerLearner(env, DaggerConfig(**{"hidden": (16,), "horizon": 8, "minibatch": 64} | settings))


def test_the_loss_is_the_likelihood_of_what_the_teacher_would_do():
    _, learner = make()
    with torch.no_grad():
        for values in learner.policy.body.parameters():
            values.zero_()
        learner.policy.log_std[:] = torch.tensor([math.log(0.1), math.log(2.0)])
    rows = torch.tensor([[7.0, 8.0, 0.2, 1.0], [5.0, 6.0, 0.0, -1.0]])
    steering = [0.5 * 2.0**2, 0.0]  # the policy says 0; 0.2 are two deviations of 0.1
    throttle = [0.5 * 0.5**2] * 2
    constant = math.log(0.1) + math.log(2.0) + math.log(2.0 * math.pi)
    assert learner.loss(rows).item() == pytest.approx(np.mean(steering) + np.mean(throttle) + constant, abs=1e-6)


def test_the_teacher_drives_first_and_the_policy_at_the_end():
    env, learner = make(half_life=0.05)
    learner.round()
    for done, taught in env.driven[:8]:
        np.testing.assert_array_equal(done, taught)
    assert learner.round()[0] == 8 * 60  # rows without an agent are not kept
    for done, taught in env.driven[8:]:
        assert abs(done - taught)[:60, 1].mean() > 0.01


def test_a_network_learns_the_controls_and_takes_observations_as_they_are():
    env, learner = make(steps=60 * 8 * 60, rate=1e-2)
    for _ in range(60):
        learned = learner.round()[1]
    seen, taught = env.observations[:60, :2], env.observations[:60, 2:]
    found = learner.mode(seen)
    assert abs(found - taught)[:, 0].max() < 0.005 and abs(found - taught)[:, 1].max() < 0.1
    assert learned["steering_error"] < learned["throttle_error"] < 0.02
    arrays = {name: value.numpy() for name, value in learner.tensors().items()}
    np.testing.assert_allclose(TrainedDriver.of_arrays(arrays, 0)(seen), found, atol=1e-5)


def test_a_run_gives_a_driver_that_sees_the_route_and_not_the_teacher(drives, tmp_path):
    lake = Lake(shutil.copytree(drives, tmp_path / "lake"))
    lake.filter("true", name="six")
    config = DaggerConfig(worlds=3, horizon=20, minibatch=32, updates=3, steps=200, hidden=(8,))
    report = train(lake, algorithm="dagger", config=config, name="taught", tests=["six"])
    driver = load_driver(open_files(lake.root), "runs/taught")
    assert driver.sensors == ROUTE_OBSERVATION and report.tests["six@1"]["episodes"] == 6
    (width,) = Observation(ROUTE_OBSERVATION, "flat").space.shape
    assert driver(np.zeros((1, width), np.float32)).shape == (1, 2)
