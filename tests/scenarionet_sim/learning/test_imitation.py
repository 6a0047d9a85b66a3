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


@pytest.mark.parametrize("is_limited", [False, True])
def test_inverse_dynamics_finds_the_controls_of_the_bicycle_model(is_limited):
    """On held-out transitions that neither tyres nor steering rate cut, within 5 % of the actions' variance."""
    rng, count = np.random.default_rng(0), 20_000
    free = [np.radians(40.0), 4.0, 8.0, 40.0, 0.6, np.inf, np.inf, *[0.0] * 4]  # see bicycle_kernels
    limited = [*free[:5], 8.0, np.radians(45.0), *[0.0] * 4]
    controls = rng.uniform(-1.0, 1.0, (count, 2))
    motion, size = np.zeros((1, count, 7)), np.tile([4.6, 1.9, 1.6], (1, count, 1))
    heading, speed = rng.uniform(-np.pi, np.pi, count), rng.uniform(2.0, 8.0, count)
    motion[0, :, 3], motion[0, :, 4], motion[0, :, 5] = heading, speed * np.cos(heading), speed * np.sin(heading)
    agents = np.stack([np.zeros(count), np.arange(count)], axis=1).astype(np.int32)
    after, uncut = motion.copy(), motion.copy()
    drive_bicycles(agents, controls, 0.1, 5, np.tile(limited if is_limited else free, (1, count, 1)), size, after)
    drive_bicycles(agents, controls, 0.1, 5, np.tile(free, (1, count, 1)), size, uncut)

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
        inverse.learn(pairs[:-5000], wanted[:-5000], steps, 512, generator)
    held = np.flatnonzero((after == uncut).all(axis=(0, 2))[-5000:]) + count - 5000
    assert len(held) > 100
    missed = (inverse(pairs[held]) - wanted[held]).detach().square().mean(dim=0)
    assert (missed < 0.05 * wanted.var(dim=0)).all()
    assert is_limited or missed.mean() < 1e-3


def test_the_error_of_inverse_dynamics_is_a_share_of_the_variance():
    """It says 0 for controls -1, 1 and -2, 2: the squares are 1 and 4, and so are the variances."""
    inverse = InverseDynamics(1, (4,), 1e-3)
    inverse.network = torch.nn.Linear(2, 2)
    for part in inverse.network.parameters():
        part.data.zero_()
    controls = torch.tensor([[-1.0, -2.0], [1.0, 2.0]])
    assert inverse.error(torch.zeros(2, 2, 1), controls) == 1.0
    inverse.network.bias.data[:] = torch.tensor([1.0, 0.0])  # squares 4, 0 and 4, 4
    assert inverse.error(torch.zeros(2, 2, 1), controls) == pytest.approx(3.0 / 2.5)


@pytest.mark.parametrize(("enough", "expected"), [(0.0, 4), (1e9, 1)])
def test_inverse_dynamics_learns_until_it_knows_transitions_that_it_has_not_seen(env, enough, expected):
    settings = SETTINGS | {"inverse_series": 4, "inverse_error": enough, "inverse_steps": 2}
    learner = AirlLearner(env, AirlConfig(**settings), 1, experts(env))
    calls, learn = [], learner.inverse.learn
    learner.inverse.learn = lambda *given: calls.append(given) or learn(*given)
    learned = learner._before_discriminator(torch.randn(100, 2, env.observations.shape[1]), torch.rand(100, 2))
    assert len(calls) == expected and len(calls[0][0]) == 90 and learned["inverse_error"] > 0.0


@pytest.mark.parametrize(("noise", "low", "high"), [(0.0, 0.99, 1.0), (0.02, 0.5, 0.7)])
def test_noise_hides_that_experts_keep_a_column_constant(env, noise, low, high):
    """Others are 0.005 beside it: with noise of 0.02 the best guess is right with Phi(0.005 sqrt 2 / 0.04) = 57 %."""
    width = env.observations.shape[1]
    theirs, mine = torch.zeros(2000, 2, width), torch.zeros(2000, 2, width)
    mine[..., 1] = 0.005
    config = GailConfig(**SETTINGS, discriminator_rate=0.01, discriminator_epochs=30, input_noise=noise)
    learner = GailLearner(env, config, 1, Experts(theirs))
    learner._learn_discriminator(mine, torch.zeros(2000))
    accuracy = learner._learn_discriminator(mine, torch.zeros(2000))["discriminator_accuracy"]
    assert low <= accuracy <= high


def test_columns_that_experts_keep_constant_are_not_magnified():
    seen = torch.zeros(4, 2, 2)
    seen[..., 0], seen[::2, :, 1] = torch.tensor(0.3), 1.0
    found = Experts(seen)
    assert found.deviation[0] == pytest.approx(0.05)
    assert found.deviation[1] == pytest.approx(np.std([1.0, 0.0] * 4, ddof=1))


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
