"""GAIL sees no action, AIRL finds actions by inverse dynamics, TD3 keeps its replay in a ring."""

from __future__ import annotations

import numpy as np
import pytest

pytestmark = pytest.mark.learn
torch = pytest.importorskip("torch", reason="no torch: run `make test-learn`")

from scenarionet_sim.backends.bicycle_kernels import drive_bicycles  # noqa: E402
from scenarionet_sim.environments.config import MultiAgentConfig  # noqa: E402
from scenarionet_sim.environments.flat import FlatEnv  # noqa: E402
from scenarionet_sim.learning.airl import AirlLearner, InverseDynamics  # noqa: E402
from scenarionet_sim.learning.config import AirlConfig, GailConfig  # noqa: E402
from scenarionet_sim.learning.experts import Experts  # noqa: E402
from scenarionet_sim.learning.gail import GailLearner  # noqa: E402
from scenarionet_sim.learning.td3 import ReplayBuffer  # noqa: E402

SETTINGS = {"worlds": 2, "seats": 10, "hidden": (16, 16), "horizon": 12, "minibatch": 64, "epochs": 1}


@pytest.fixture
def env(only):
    made = FlatEnv(2, MultiAgentConfig(only("crowd")), 10, seed=0, threads=1)
    made.reset()
    yield made
    made.close()


def experts(env):
    return Experts(torch.randn(500, 2, env.observations.shape[1], generator=torch.Generator().manual_seed(0)))


@pytest.mark.parametrize("actions", ["real", "nan"])
@pytest.mark.parametrize("options", [{}, {"gradient_penalty": 1.0, "normalizes": True, "input_noise": 0.1}])
def test_the_discriminator_is_never_given_an_action(env, actions, options):
    """With NaN for every action it learns the same weights, and rewards the same."""
    learner = GailLearner(env, GailConfig(**SETTINGS, **options), 1, experts(env))
    rollout = learner._collect()
    if actions == "nan":
        rollout.actions.fill_(torch.nan)
        rollout.log_probabilities.fill_(torch.nan)
    seen = []
    learner._learn = lambda batch: seen.append(batch) or {}
    learned = learner._update(rollout)
    weights = learner.discriminators["discriminator"].state_dict()
    mine = [*weights.values(), seen[0].advantages, torch.tensor(learned["given"])]
    assert all(torch.isfinite(values).all() for values in mine)
    other = BEFORE.setdefault(tuple(options), mine)
    assert all(torch.equal(first, second) for first, second in zip(mine, other, strict=True))


BEFORE: dict[tuple, list] = {}


def test_the_discriminator_tells_experts_from_others(env):
    learner = GailLearner(
        env, GailConfig(**SETTINGS, discriminator_rate=1e-3, discriminator_epochs=20), 1, experts(env)
    )
    first, *_, last = [learner.round()[1]["discriminator_accuracy"] for _ in range(4)]
    assert first < last and last > 0.9


def test_airl_and_discrete_policies_learn(env):
    for kind, config in ((AirlLearner, AirlConfig), (GailLearner, GailConfig)):
        learner = kind(env, config(**SETTINGS, bins=5), 1, experts(env))
        learned = [learner.round()[1] for _ in range(2)][-1]
        assert all(np.isfinite(value) for value in learned.values())


def test_inverse_dynamics_finds_the_controls_of_the_bicycle_model():
    """The mean squared error is below 0.001 on transitions that it has not seen."""
    rng, count = np.random.default_rng(0), 20_000
    vehicle = [np.radians(40.0), 4.0, 8.0, 40.0, 0.6, np.inf, np.inf, *[0.0] * 4]  # no limit cuts, see bicycle_kernels
    controls = rng.uniform(-1.0, 1.0, (count, 2))
    motion, size = np.zeros((1, count, 7)), np.tile([4.6, 1.9, 1.6], (1, count, 1))
    heading, speed = rng.uniform(-np.pi, np.pi, count), rng.uniform(2.0, 8.0, count)
    motion[0, :, 3], motion[0, :, 4], motion[0, :, 5] = heading, speed * np.cos(heading), speed * np.sin(heading)
    agents = np.stack([np.zeros(count), np.arange(count)], axis=1).astype(np.int32)
    after = motion.copy()
    drive_bicycles(agents, controls, 0.1, 5, np.tile(vehicle, (1, count, 1)), size, after)

    def observed(state):
        """Speed along the first heading, change of the heading, in the ego's frame, as its sensors see them."""
        turn = (state[0, :, 3] - heading + np.pi) % (2 * np.pi) - np.pi
        along = np.hypot(state[0, :, 4], state[0, :, 5])
        return np.stack([along / 10.0, turn, state[0, :, 6]], axis=1)

    pairs = torch.tensor(np.stack([observed(motion), observed(after)], axis=1), dtype=torch.float32)
    wanted = torch.tensor(controls, dtype=torch.float32)
    torch.manual_seed(0)
    inverse = InverseDynamics(3, (64, 64), 3e-3)
    generator = torch.Generator().manual_seed(0)
    for rate, steps in ((3e-3, 1500), (3e-4, 700)):
        inverse.adam.param_groups[0]["lr"] = rate
        inverse.learn(pairs[:-2000], wanted[:-2000], steps, 512, generator)
    error = (inverse(pairs[-2000:]) - wanted[-2000:]).square().mean().item()
    assert error < 1e-3


def test_a_replay_keeps_the_newest_transitions():
    replay = ReplayBuffer(5, 1)
    for first in (0, 3, 6):
        numbers = torch.arange(first, first + 3, dtype=torch.float32)
        pair = torch.stack([numbers, numbers], dim=1)
        replay.add(seen=numbers[:, None], actions=pair, rewards=numbers, after=numbers[:, None], goes_on=numbers)
    assert sorted(replay.tensors["rewards"].tolist()) == [4.0, 5.0, 6.0, 7.0, 8.0]
    drawn = replay.draw(100, torch.Generator().manual_seed(0))
    assert set(drawn["rewards"].tolist()) == {4.0, 5.0, 6.0, 7.0, 8.0}
    assert torch.equal(drawn["seen"][:, 0], drawn["rewards"])
