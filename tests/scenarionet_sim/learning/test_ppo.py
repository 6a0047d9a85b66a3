"""PPO: advantages against a loop, the loss against Stable-Baselines3."""

from __future__ import annotations

import numpy as np
import pytest

pytestmark = pytest.mark.learn
torch = pytest.importorskip("torch", reason="no torch: run `make test-learn`")

from scenarionet_sim.learning.config import PpoConfig  # noqa: E402
from scenarionet_sim.learning.descent import Descent  # noqa: E402
from scenarionet_sim.learning.networks import DiscretePolicy, GaussianPolicy, perceptron  # noqa: E402
from scenarionet_sim.learning.ppo import Batch, ppo_loss, standardized  # noqa: E402
from scenarionet_sim.learning.rollout import advantages, neighbour_rewards  # noqa: E402


def test_advantages_equal_a_sum_over_the_rest_of_each_episode():
    """Rows in which agents come, leave by arriving, by running out of time, and stay to the end of the round."""
    rng, gamma, smoothing = np.random.default_rng(0), 0.9, 0.8
    rewards, values = rng.normal(size=(12, 3)).astype("f4"), rng.normal(size=(13, 3)).astype("f4")
    ends = rng.random((12, 3)) < 0.25
    last_values = np.where(ends & (rng.random((12, 3)) < 0.5), 3.0, 0.0).astype("f4")
    found = advantages(rewards, values, last_values, ends, gamma, smoothing)
    for row in range(3):
        for step in range(12):
            expected, weight = 0.0, 1.0
            for later in range(step, 12):
                after = last_values[later, row] if ends[later, row] else values[later + 1, row]
                expected += weight * (rewards[later, row] + gamma * after - values[later, row])
                weight *= gamma * smoothing
                if ends[later, row]:
                    break
            assert found[step, row] == pytest.approx(expected, abs=1e-5)


def test_neighbours_are_near_alive_and_of_the_same_world():
    positions = np.array([[0.0, 0.0], [30.0, 0.0], [60.0, 0.0], [0.0, 1.0], [0.0, 2.0]])
    worlds, alive = np.array([0, 0, 0, 0, 1]), np.array([True, True, True, False, True])
    rewards = np.array([1.0, 2.0, 4.0, 100.0, 100.0], "f4")
    found = neighbour_rewards(rewards, positions, worlds, alive, 40.0)
    np.testing.assert_array_equal(found, [2.0, 2.5, 2.0, 0.0, 0.0])


def test_discrete_policies_are_categorical():
    torch.manual_seed(0)
    policy, seen = DiscretePolicy(4, [8], 5), torch.randn(7, 4)
    with torch.no_grad():
        policy.body[-1].weight.normal_()
    given = policy(seen)
    actions = policy.draw(given, torch.Generator().manual_seed(0))
    logits = policy.body(seen).view(7, 2, 5)
    expected = torch.distributions.Categorical(logits=logits)
    torch.testing.assert_close(policy.log_probability(given, actions), expected.log_prob(actions).sum(1))
    torch.testing.assert_close(policy.entropy(given), expected.entropy().sum(1))
    assert policy.controls(torch.tensor([[0.0, 4.0], [2.0, 1.0]])).tolist() == [[-1.0, 1.0], [0.0, -0.5]]


def test_the_loss_equals_stable_baselines():
    """Same weights, same batch: its loss, and the weights after its update, to 1e-5."""
    sb3 = pytest.importorskip("stable_baselines3")
    gymnasium = pytest.importorskip("gymnasium")
    config = PpoConfig(hidden=(32, 16), entropy=0.01, value_weight=0.5, clip=0.2)
    env = gymnasium.make("Pendulum-v1")
    env.action_space = gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32)
    kwargs = {"net_arch": [32, 16], "log_std_init": float(np.log(config.spread))}
    settings = {"ent_coef": config.entropy, "vf_coef": config.value_weight, "clip_range": config.clip, "n_epochs": 1}
    settings |= {"n_steps": 64, "batch_size": 64, "policy_kwargs": kwargs, "device": "cpu"}
    theirs = sb3.PPO("MlpPolicy", env, seed=0, **settings)
    torch.manual_seed(0)
    policy, critic = GaussianPolicy(3, [32, 16], config.spread), perceptron([3, 32, 16, 1])
    extractor = theirs.policy.mlp_extractor
    with torch.no_grad():
        policy.log_std.add_(torch.tensor([0.1, -0.2]))
        theirs.policy.log_std.copy_(policy.log_std)
        pairs = [(policy.body, extractor.policy_net, theirs.policy.action_net)]
        pairs += [(critic, extractor.value_net, theirs.policy.value_net)]
        for mine, body, head in pairs:
            for source, target in zip(mine[::2], [*body[::2], head], strict=True):
                target.load_state_dict(source.state_dict())
    generator = torch.Generator().manual_seed(1)
    seen, actions = torch.randn(64, 3, generator=generator), torch.randn(64, 2, generator=generator)
    logs, returns = torch.randn(64, generator=generator) - 2.0, torch.randn(64, generator=generator)
    estimates = torch.randn(64, generator=generator)
    filled = {"observations": seen, "actions": actions, "log_probs": logs, "advantages": estimates, "returns": returns}
    for name, values in filled.items():
        array = getattr(theirs.rollout_buffer, name)
        array[:] = values.numpy().reshape(array.shape)
    theirs.rollout_buffer.full = True
    theirs.set_logger(sb3.common.logger.Logger(None, []))
    theirs.train()

    batch = Batch(seen, actions, logs, standardized(estimates), returns[:, None], returns[:, None])
    loss, _ = ppo_loss(policy, critic, batch, config)
    assert loss.item() == pytest.approx(theirs.logger.name_to_value["train/loss"], abs=1e-5)
    Descent([*policy.parameters(), *critic.parameters()], 3e-4, 0.5).step(loss)
    torch.testing.assert_close(policy.log_std, theirs.policy.log_std, atol=1e-5, rtol=0.0)
    for mine, body, head in pairs:
        for source, target in zip(mine[::2], [*body[::2], head], strict=True):
            torch.testing.assert_close(source.weight, target.weight, atol=1e-5, rtol=0.0)
