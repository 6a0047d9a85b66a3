"""CoPO: advantage and meta-gradient of three agents by hand; without an angle it is IPPO."""

from __future__ import annotations

import math

import numpy as np
import pytest

pytestmark = pytest.mark.learn
torch = pytest.importorskip("torch", reason="no torch: run `make test-learn`")

from torch import nn  # noqa: E402

from scenarionet_sim.environments.config import MultiAgentConfig  # noqa: E402
from scenarionet_sim.environments.flat import FlatEnv  # noqa: E402
from scenarionet_sim.learning.config import CopoConfig, IppoConfig  # noqa: E402
from scenarionet_sim.learning.copo import (  # noqa: E402
    AngleDistribution,
    CopoLearner,
    SocialAdvantages,
    agreement,
    coordinated,
    meta_loss,
)
from scenarionet_sim.learning.ppo import Batch, PpoLearner  # noqa: E402

OWN, NEAR, ALL = (1.0, -2.0, 0.5), (0.5, 1.0, -1.0), (1.0, -1.0, 0.25)
SEEN, ACTIONS = (0.5, -1.0, 2.0), (0.3, -0.4, 1.2)


class Line(nn.Module):
    """A policy with one weight: the action is normal around ``weight * observation`` with deviation 1."""

    def __init__(self, weight):
        super().__init__()
        self.weight = nn.Parameter(torch.tensor(weight, dtype=torch.float64))

    def forward(self, observations):
        return self.weight * observations[:, 0]

    def log_probability(self, means, actions):
        return -0.5 * (actions[:, 0] - means).square() - 0.5 * math.log(2 * math.pi)


def test_the_advantage_of_three_agents_by_hand():
    angles = (0.0, 0.5, -0.25)  # 0, 45 and -22.5 degrees
    found = coordinated(torch.tensor(OWN), torch.tensor(NEAR), torch.tensor(angles))
    root = math.sqrt(0.5)
    eighth = math.cos(math.pi / 8) * 0.5 + math.sin(math.pi / 8) * 1.0
    np.testing.assert_allclose(found, [1.0, -2.0 * root + root, eighth], atol=1e-6)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_the_mean_angle_stays_below_ninety_degrees(side):
    """At 90 degrees the inverse hyperbolic tangent of the mean would be infinite."""
    distribution = AngleDistribution(0.1)
    with torch.no_grad():
        distribution.parameters_[0] = 50.0 * side
    mean = float(distribution.draw(torch.zeros(1)).detach())
    assert 1e-7 < 1.0 - side * mean < 2e-6


def test_the_meta_gradient_of_three_agents_by_hand():
    """Derivatives written out for a policy with one weight; nothing of it comes from automatic differentiation."""
    new, old, clip = 0.8, 0.7, 0.2
    double = {"dtype": torch.float64}

    def log_probability(weight, seen, action):
        return -0.5 * (action - weight * seen) ** 2 - 0.5 * math.log(2 * math.pi)

    before = [log_probability(old, seen, action) for seen, action in zip(SEEN, ACTIONS, strict=True)]
    g_new = g_old = 0.0
    for seen, action, log, advantage in zip(SEEN, ACTIONS, before, ALL, strict=True):
        ratio = math.exp(log_probability(new, seen, action) - log)
        slope = ratio * (action - new * seen) * seen
        is_held = ratio * advantage > min(max(ratio, 1 - clip), 1 + clip) * advantage
        g_new -= (0.0 if is_held else advantage * slope) / 3
        g_old += (action - old * seen) * seen / 3
    batch = Batch(
        torch.tensor(SEEN, **double)[:, None], torch.tensor(ACTIONS, **double)[:, None],
        torch.tensor(before, **double), *(torch.zeros(3, **double) for _ in range(3)),
    )  # fmt: skip
    agrees = agreement(Line(new), Line(old), batch, torch.tensor(ALL, **double), clip)
    assert float(agrees) == pytest.approx(g_new * g_old, abs=1e-6)

    distribution, noise, mean, deviation = AngleDistribution(0.1).double(), (0.5, -1.0, 2.0), 0.2, 1.5
    social = SocialAdvantages(*(torch.tensor(values, **double) for values in (OWN, NEAR, ALL)))
    angles = distribution.draw(torch.tensor(noise, **double))
    meta_loss(agrees.detach(), angles, social, torch.tensor(mean), torch.tensor(deviation)).backward()
    by_mean = by_log = 0.0
    for own, near, draw in zip(OWN, NEAR, noise, strict=True):
        angle = (0.0 + 0.1 * draw) * math.pi / 2
        slope = (-math.sin(angle) * own + math.cos(angle) * near) * math.pi / 2
        by_mean += g_new * g_old * slope / deviation / 3  # the derivative of tanh at 0 is 1
        by_log += g_new * g_old * slope * 0.1 * draw / deviation / 3
    np.testing.assert_allclose(distribution.parameters_.grad, [by_mean, by_log], atol=1e-6)


def test_without_an_angle_it_is_ippo_to_the_bit(only):
    settings = {"worlds": 2, "seats": 10, "hidden": (16, 16), "horizon": 12, "minibatch": 64, "epochs": 2}
    ippo, copo = IppoConfig(**settings), CopoConfig(**settings, angle_spread=0.0, angle_epochs=0)
    weights = []
    for make in (lambda env: PpoLearner(env, ippo, 3), lambda env: CopoLearner(env, copo, 3)):
        env = FlatEnv(2, MultiAgentConfig(only("crowd")), 10, seed=0, threads=1)
        env.reset()
        learner = make(env)
        learned = [learner.round()[1] for _ in range(4)]
        weights.append([learner.policy.state_dict(), learner.critic.state_dict(), learned[-1]["policy_loss"]])
        env.close()
    for mine, theirs in zip(*weights, strict=True):
        if isinstance(mine, float):
            assert mine == theirs
        else:
            assert all(torch.equal(mine[name], theirs[name]) for name in mine)


def test_the_angle_moves(only):
    settings = {"worlds": 2, "seats": 10, "hidden": (16, 16), "horizon": 12, "minibatch": 64, "epochs": 2}
    env = FlatEnv(2, MultiAgentConfig(only("crowd")), 10, seed=0, threads=1)
    env.reset()
    learner = CopoLearner(env, CopoConfig(**settings, angle_rate=0.01), 3)
    angles = [learner.round()[1]["angle"] for _ in range(3)]
    assert len(set(angles)) == 3 and 0.0 < max(map(abs, angles)) < 90.0
    env.close()
