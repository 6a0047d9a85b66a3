"""Rewards, targets and advantages of single steps, computed by hand: networks are constants or sums of their inputs."""

from __future__ import annotations

import math

import numpy as np
import pytest

pytestmark = pytest.mark.learn
torch = pytest.importorskip("torch", reason="no torch: run `make test-learn`")

from torch import nn  # noqa: E402

from scenarionet_sim.learning.airl import AirlLearner  # noqa: E402
from scenarionet_sim.learning.config import AirlConfig, CopoConfig, GailConfig, PpoConfig, Td3Config  # noqa: E402
from scenarionet_sim.learning.copo import CopoLearner  # noqa: E402
from scenarionet_sim.learning.experts import Experts  # noqa: E402
from scenarionet_sim.learning.gail import GailLearner  # noqa: E402
from scenarionet_sim.learning.ppo import PpoLearner  # noqa: E402
from scenarionet_sim.learning.td3 import Td3Learner  # noqa: E402
from scenarionet_sim.task.scoring_kernels import NUMBERS  # noqa: E402

SMALL = {"hidden": (4,), "worlds": 1, "horizon": 2}


class Scripted:
    """Three agents whose first ends with a terminal state in the first step, the second by running out of time.

    Observations are 1, 2, 3 before the first step, 10 times as large after it, but those after an end are 100, 200.
    """

    num_agents = seats = 3

    def __init__(self):
        self.observations = np.array([[1.0], [2.0], [3.0]], np.float32)
        self.last_observations, self.last_numbers = np.zeros((3, 1), np.float32), np.zeros((3, len(NUMBERS)))
        self.rewards = np.zeros(3, np.float32)
        self.terminals, self.truncations, self.arrivals = (np.zeros(3, np.bool_) for _ in range(3))
        self.masks, self.positions = np.ones(3, np.bool_), np.array([[0.0, 0.0], [3.0, 4.0], [40.0, 0.0]])

    def step(self, actions):
        del actions
        is_first = self.observations[2, 0] == 3.0
        self.terminals[0], self.truncations[1] = is_first, is_first
        self.last_observations[:, 0] = [100.0, 200.0, 0.0]
        self.observations = np.array([[10.0], [20.0], [30.0]], np.float32) * (1.0 if is_first else 2.0)
        self.rewards = np.array([1.0, 2.0, 4.0], np.float32)

    def scenario_id(self, row):
        return str(row)


class Sum(nn.Module):
    """The sum of the inputs times a factor, as a column."""

    def __init__(self, factor=1.0, bias=0.0):
        super().__init__()
        self.factor, self.bias = nn.Parameter(torch.tensor(factor)), nn.Parameter(torch.tensor(bias))

    def forward(self, inputs):
        return self.factor * inputs.sum(dim=-1, keepdim=True) + self.bias


def test_truncated_episodes_count_the_value_of_their_last_observation_and_terminal_ones_do_not():
    learner = PpoLearner(Scripted(), PpoConfig(**SMALL, gamma=0.9, smoothing=0.5))
    rollout = learner._collect()
    found, values = learner.estimate(Sum(0.01), rollout, (0.9,))
    np.testing.assert_allclose(values[:, 0], [0.01, 0.02, 0.03, 0.1, 0.2, 0.3], rtol=1e-6)
    second = np.array([1.0 + 0.9 * 0.2 - 0.1, 2.0 + 0.9 * 0.4 - 0.2, 4.0 + 0.9 * 0.6 - 0.3])  # the next is 20, 40, 60
    first = [
        1.0 - 0.01,  # ended
        2.0 + 0.9 * 2.0 - 0.02,  # ran out of time at 200
        4.0 + 0.9 * 0.3 - 0.03 + 0.9 * 0.5 * second[2],  # goes on
    ]
    np.testing.assert_allclose(found[:, 0], [*first, *second], rtol=1e-6)


def test_rewards_of_the_neighbourhood_leave_the_agent_out_and_those_of_all_do_not():
    learner = CopoLearner(Scripted(), CopoConfig(**SMALL, neighbourhood=10.0, reward_scale=0.5))
    rewards = learner._collect().rewards
    own, near, of_all = rewards[0].T
    np.testing.assert_allclose(own, [0.5, 1.0, 2.0])
    np.testing.assert_allclose(near, [1.0, 0.5, 0.0])  # the first two are 5 m apart, the third has no neighbour
    np.testing.assert_allclose(of_all, [3.5 / 3] * 3, rtol=1e-6)


def test_copo_learns_its_angle_from_the_advantages_of_its_own_the_neighbours_and_all():
    """Without a look ahead, and where all values are 0, advantages are rewards; the mean angle is 90 tanh(1/2)."""
    config = CopoConfig(**SMALL, neighbourhood=10.0, reward_scale=0.5, gamma=1e-9, global_gamma=1e-9, angle_rate=0.0)
    learner, given = CopoLearner(Scripted(), config), []
    learner.critic = Constant(0.0)
    learner.critic.forward = lambda seen: torch.zeros(len(seen), 1)
    with torch.no_grad():
        for weights in learner.social_critic.parameters():
            weights.zero_()
    learner._learn = lambda batch: {}
    learner._learn_angle = lambda old, batch, social, mean, deviation: given.append(social)
    with torch.no_grad():
        learner.angle.parameters_[0] = 0.5
    rollout = learner._collect()
    rollout.rewards[1, 2, 2] = 9.0  # so that the advantages of all are not all the same
    learned = learner._update(rollout)
    np.testing.assert_allclose(given[0].own, [0.5, 1.0, 2.0] * 2, rtol=1e-6)
    np.testing.assert_allclose(given[0].neighbour, [1.0, 0.5, 0.0] * 2, rtol=1e-6)
    assert (np.diff(given[0].all)[:4] == 0.0).all() and given[0].all[5] > 1.0 > 0.0 > given[0].all[0]
    assert learned["angle"] == pytest.approx(90.0 * math.tanh(0.5))


def test_the_replay_bootstraps_from_last_observations_but_not_after_terminal_states():
    learner = Td3Learner(Scripted(), Td3Config(hidden=(4,), worlds=1, horizon=1, reward_scale=0.5, replay=3))
    learner.round()
    replay = learner._replay.tensors
    assert replay["seen"][:, 0].tolist() == [1.0, 2.0, 3.0]
    assert replay["after"][:, 0].tolist() == [100.0, 200.0, 30.0]
    assert replay["goes_on"].tolist() == [0.0, 1.0, 1.0]
    assert replay["rewards"].tolist() == [0.5, 1.0, 2.0]


def test_td3_acts_at_random_and_learns_nothing_until_it_is_warm():
    learner = Td3Learner(Scripted(), Td3Config(hidden=(4,), worlds=1, horizon=50, minibatch=8, warm_up=200, replay=300))
    assert learner.round() == (150, {})
    actions = learner._replay.tensors["actions"][:150]
    assert actions.min() < -0.9 and actions.max() > 0.9 and abs(actions.mean()) < 0.15  # uniform between -1 and 1
    steps, learned = learner.round()
    assert steps == 150 and "critic_loss" in learned


@pytest.mark.parametrize(("goes_on", "slow"), [(0.0, 0.5), (1.0, 0.5), (1.0, -0.5)])
def test_the_target_of_td3_is_the_smaller_of_both_critics_at_the_clipped_action(goes_on, slow):
    """The slow policy's noise is cut to at most 0.2; critics add up observation and actions."""
    config = Td3Config(hidden=(4,), worlds=1, minibatch=64, gamma=0.9, target_noise=100.0, target_clip=0.2, delay=10)
    learner = Td3Learner(Scripted(), config)
    learner.networks |= {"slow_policy": Constant(slow), "slow_first": Sum(), "slow_second": Sum(2.0)}
    nothing = torch.zeros(1)
    learner._replay.add(
        seen=torch.ones(1, 1), actions=torch.zeros(1, 2), rewards=nothing + 3.0, after=nothing[None] + 7.0,
        goes_on=nothing + goes_on,
    )  # fmt: skip
    target = float(learner._update()["value"])
    if not goes_on:
        assert target == 3.0
    else:  # of 64 pairs of actions 0.2 beside what the policy says, so their sum is twice that on average
        assert target == pytest.approx(3.0 + 0.9 * (7.0 + 2.0 * slow), abs=0.9 * 0.15)
        assert target != 3.0 + 0.9 * (7.0 + 2.0 * slow)


class Constant(nn.Module):
    def __init__(self, value):
        super().__init__()
        self.value = value

    def forward(self, observations):
        return torch.full((len(observations), 2), self.value)


def test_the_slow_networks_follow_and_the_policy_learns_with_a_delay():
    config = Td3Config(hidden=(4,), worlds=1, minibatch=8, delay=2, tau=0.25)
    learner = Td3Learner(Scripted(), config)
    learner.round()
    before = {name: [part.clone() for part in net.parameters()] for name, net in learner.networks.items()}
    assert "policy_loss" not in learner._update()
    assert all(map(torch.equal, before["policy"], learner.networks["policy"].parameters()))
    assert "policy_loss" in learner._update()
    for name in ("policy", "first", "second"):
        parts = zip(before[name], learner.networks[name].parameters(), strict=True)
        expected = [0.75 * old + 0.25 * new for old, new in parts]
        torch.testing.assert_close(list(learner.networks[f"slow_{name}"].parameters()), expected)


def imitate(learner):
    """Make an update with the networks as they are; return the rewards of the first step and what was learned."""
    rollout = learner._collect()
    learner._learn = lambda batch: {}
    learned = learner._update(rollout)
    return rollout.rewards[0, :, 0], learned


EXPERTS = Experts(torch.zeros(10, 2, 1))


@pytest.mark.parametrize(("reward", "expected"), [("log", math.log(4.0)), ("logit", math.log(3.0))])
def test_the_reward_of_gail_is_the_discriminators_belief(reward, expected):
    """Where D = 3/4: -log(1 - D) = log 4, and log D - log(1 - D) = log 3; the loss is -log 3/4 - log 1/4."""
    config = GailConfig(**SMALL, seats=3, reward=reward, discriminator_rate=0.0, discriminator_decay=0.0)
    learner = GailLearner(Scripted(), config, 0, EXPERTS)
    learner.discriminators["discriminator"] = Sum(0.0, math.log(3.0))
    rewards, learned = imitate(learner)
    np.testing.assert_allclose(rewards, expected, rtol=1e-6)
    assert learned["discriminator_loss"] == pytest.approx(-math.log(3 / 4) - math.log(1 / 4))
    assert learned["discriminator_accuracy"] == 0.5


def test_the_gradient_penalty_moves_the_discriminator():
    """The logit f (s + s') has the gradient (f, f), so the penalty is (√2 f - 1)², its derivative 2 √2 (√2 f - 1)."""
    learner = GailLearner(Scripted(), GailConfig(**SMALL, seats=3), 0, EXPERTS)
    discriminator = learner.discriminators["discriminator"] = Sum(2.0)
    penalty = learner._penalty(torch.zeros(4, 2, 1), torch.ones(4, 2, 1))
    penalty.backward()
    root = math.sqrt(2.0)
    assert float(penalty.detach()) == pytest.approx((2.0 * root - 1.0) ** 2)
    assert float(discriminator.factor.grad) == pytest.approx(2.0 * root * (2.0 * root - 1.0))


@pytest.mark.parametrize("kind", [GailConfig, AirlConfig])
def test_staying_alive_pays_nothing_by_default(kind):
    """Where D = 1/2, log D - log(1 - D) = 0, while -log(1 - D) = log 2 in every step."""
    learner = GailLearner(Scripted(), GailConfig(**SMALL, seats=3, discriminator_rate=0.0), 0, EXPERTS)
    learner.discriminators["discriminator"] = Sum(0.0, 0.0)
    assert kind().reward == "logit" and imitate(learner)[0].tolist() == [0.0, 0.0, 0.0]


def test_the_discriminator_sees_the_state_and_the_next_one():
    config = GailConfig(**SMALL, seats=3, reward="logit", discriminator_rate=0.0, discriminator_decay=0.0)
    learner = GailLearner(Scripted(), config, 0, EXPERTS)
    learner.discriminators["discriminator"] = Sum(0.5)
    rewards, _ = imitate(learner)
    np.testing.assert_allclose(rewards, [0.5 * 101.0, 0.5 * 202.0, 0.5 * 33.0])


def test_the_reward_of_airl_is_reward_and_shaping_less_the_log_probability():
    """f = g(s) + gamma h(s') - h(s) with g = s, h = s / 10; the logit is f - log pi."""
    config = AirlConfig(**SMALL, seats=3, gamma=0.5, inverse_steps=0, discriminator_rate=0.0)
    learner = AirlLearner(Scripted(), config, 0, EXPERTS)
    learner.discriminators |= {"reward": Sum(), "shaping": Sum(0.1)}
    rollout = learner._collect()
    logs = rollout.log_probabilities[0].numpy()
    learner._learn = lambda batch: {}
    learner._update(rollout)
    f = np.array([1.0 + 0.5 * 10.0 - 0.1, 2.0 + 0.5 * 20.0 - 0.2, 3.0 + 0.5 * 3.0 - 0.3])
    np.testing.assert_allclose(rollout.rewards[0, :, 0], f - logs, rtol=1e-5)
