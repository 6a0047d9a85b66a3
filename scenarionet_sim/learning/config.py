"""Settings of the learning algorithms: frozen dataclasses with the published values as defaults; without torch.

The settings of an algorithm name its learner. One of your own is a dataclass derived from ``LearnerConfig`` or another
one, beside its learner in a module of yours, and is trained as ``module:Class``.

Sources: *scenarionet_training*, the ScenarioNet paper's released training code; *CoPO*, the released code of Peng et
al. (2021), ``torch_copo/algo_ippo.py`` and ``algo_copo.py``; the appendix of the ScenarioNet paper, which comes first;
Fujimoto et al. (2018) for TD3; Schulman et al. (2017) for PPO's clipping range.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from types import MappingProxyType
from typing import Any, ClassVar, Literal, get_args

from scenarionet_data.errors import BadParameter
from scenarionet_data.public_names import load_by_name
from scenarionet_data.scenario.settings import Count, Natural, Positive, Share, check_settings, parse_texts
from scenarionet_sim.task.task import TASKS

TrafficDriver = Literal["replay", "idm"]


@dataclass(frozen=True)
class LearnerConfig:
    """What all algorithms share.

    Attributes:
        steps: Steps of agents to learn for, counted over all worlds.
        worlds: Worlds that step together.
        seats: Agents of a world; 1 for the ego alone.
        hidden: Widths of the hidden layers, of the policy and of the critics.
        traffic: Driver of all other vehicles: ``replay``, or ``idm`` which reacts.
        task: Reward and ends of one agent, a name in ``task.TASKS``; several agents have the paper's.
        levels: Levels of a curriculum by difficulty; 0 for all scenarios in random order.
        promotion: Success rate that ends a level.
        bins: Actions of each of steering and throttle for a discrete policy; 0 for a continuous one.
        rate: Learning rate.
        gamma: Discount per step.
        reward_scale: Factor of the rewards in the losses; recorded rewards are not scaled.
        checkpoint_every: Rounds between checkpoints; metrics are published with them.
    """

    learner: ClassVar[str]
    """``module:Class`` of the learner, see ``learners.Algorithm``."""
    needs_experts: ClassVar[bool] = False
    """Whether the learner takes ``experts`` after its other arguments."""
    small: ClassVar[Mapping[str, Any]] = MappingProxyType({})
    """What differs on one processor core: fewer passes over larger minibatches."""
    observation: ClassVar[str] = "paper"
    """What the policy sees, a name in ``environments.config.OBSERVATIONS``."""
    is_guided: ClassVar[bool] = False
    """Whether ``Guidance`` follows the observation in training; the learner takes it off, and policies never see it."""

    steps: Count = 1_000_000
    worlds: Count = 64
    seats: Count = 1
    hidden: tuple[int, ...] = (128, 128)
    traffic: TrafficDriver = "replay"
    task: str = "paper"
    levels: int = 0
    promotion: float = 0.75
    bins: Natural = 0
    rate: Positive = 3e-4
    gamma: Share = 0.99
    reward_scale: float = 1.0
    checkpoint_every: Count = 20

    def __post_init__(self) -> None:
        check_settings(self)
        if self.traffic not in get_args(TrafficDriver):
            raise BadParameter(f"traffic={self.traffic!r}; expected {' or '.join(get_args(TrafficDriver))}")
        if self.task not in (TASKS if self.seats == 1 else ("paper",)):
            raise BadParameter(f"task={self.task!r}; expected {' or '.join(TASKS)}; several agents have paper")
        if self.bins == 1:
            raise BadParameter(f"bins={self.bins}; expected 0 for continuous actions, or at least 2")


@dataclass(frozen=True)
class PpoConfig(LearnerConfig):
    """PPO for one agent per world; defaults of *scenarionet_training*, except its adaptive penalty on the divergence.

    64 worlds by 782 steps are its batch of 50,000. Its 20 epochs of minibatches of 200 are for many processor cores;
    ``small`` is for one.

    Attributes:
        horizon: Steps of each world between two updates.
        epochs, minibatch: Passes over the collected steps per update, and steps per minibatch.
        smoothing: The lambda of generalized advantage estimation.
        clip: Clipping range of the probability ratio.
        value_weight: Weight of the value loss.
        value_clip: Largest change of a value per update; 0 for no limit.
        entropy: Weight of the entropy bonus.
        longest_gradient: Gradients are scaled down to this norm.
        spread: Initial standard deviation of the actions.
    """

    learner: ClassVar[str] = "scenarionet_sim.learning.ppo:PpoLearner"
    small: ClassVar[Mapping[str, Any]] = MappingProxyType({
        "hidden": (128, 128), "rate": 1e-3, "reward_scale": 0.1, "epochs": 5, "minibatch": 1024, "horizon": 64,
        "spread": 0.6, "entropy": 1e-3, "steps": 1_000_000,
    })  # fmt: skip

    steps: Count = 20_000_000
    hidden: tuple[int, ...] = (512, 256, 128)
    rate: Positive = 1e-4
    horizon: Count = 782
    epochs: Count = 20
    minibatch: Count = 200
    smoothing: float = 0.95
    clip: float = 0.2
    value_weight: float = 0.5
    value_clip: float = 0.0
    entropy: float = 0.0
    longest_gradient: float = 0.5
    spread: float = 1.0


@dataclass(frozen=True)
class IppoConfig(PpoConfig):
    """PPO with every vehicle as an agent that learns alone; defaults of the paper's appendix and of *CoPO*.

    Batches are of about 2,000 agent steps, networks RLlib's default of two layers of 256 units.
    """

    small: ClassVar[Mapping[str, Any]] = MappingProxyType({
        "worlds": 32, "seats": 16, "hidden": (128, 128), "rate": 3e-4, "reward_scale": 0.1, "spread": 0.6, "epochs": 4,
        "minibatch": 1024,
    })  # fmt: skip

    steps: Count = 1_000_000
    worlds: Count = 4
    seats: Count = 50
    hidden: tuple[int, ...] = (256, 256)
    horizon: Count = 50
    epochs: Count = 10
    minibatch: Count = 512
    value_weight: float = 1.0
    value_clip: float = 100.0


@dataclass(frozen=True)
class CopoConfig(IppoConfig):
    """Coordinated policy optimization; defaults of *CoPO*.

    Attributes:
        neighbourhood: Radius in which agents are neighbours [m].
        global_gamma: Discount of the global value.
        angle_spread: Initial standard deviation of the local coordination factor, in units of 90 degrees.
        angle_rate, angle_epochs: Learning rate and passes of the meta-update; 0 passes freeze the factor.
    """

    learner: ClassVar[str] = "scenarionet_sim.learning.copo:CopoLearner"

    neighbourhood: float = 40.0
    global_gamma: float = 1.0
    angle_spread: float = 0.1
    angle_rate: float = 1e-4
    angle_epochs: int = 5


@dataclass(frozen=True)
class GailConfig(IppoConfig):
    """Generative adversarial imitation from states alone; defaults of the paper's appendix.

    Attributes:
        discriminator_rate, discriminator_decay: Learning rate and weight decay of the discriminator.
        discriminator_epochs, discriminator_minibatch: Its passes per update, and pairs of states per minibatch.
        reward: ``logit`` for log D - log(1 - D), which is f - log pi for AIRL; ``log`` for -log(1 - D), which is above
            0 whatever an agent does, so that staying alive pays.
        gradient_penalty: Weight of a penalty on the discriminator's gradient (Gulrajani et al. 2017); 0 for none.
        input_noise: Standard deviation of noise on the discriminator's inputs, of experts and agents alike, which hides
            that recorded vehicles keep columns exactly constant (0.02 is 0.2 m of the offset, 0.8 m/s of a speed).
        normalizes: Whether the discriminator's inputs are normalized by the experts' mean and deviation.
    """

    learner: ClassVar[str] = "scenarionet_sim.learning.gail:GailLearner"
    needs_experts: ClassVar[bool] = True
    small: ClassVar[Mapping[str, Any]] = MappingProxyType({**IppoConfig.small, "input_noise": 0.02})

    discriminator_rate: float = 5e-5
    discriminator_decay: float = 1e-5
    discriminator_epochs: int = 1
    discriminator_minibatch: int = 1024
    reward: Literal["log", "logit"] = "logit"
    gradient_penalty: float = 0.0
    input_noise: float = 0.0
    normalizes: bool = False


@dataclass(frozen=True)
class AirlConfig(GailConfig):
    """Adversarial inverse reinforcement learning with inverse dynamics; defaults of the paper's appendix.

    Attributes:
        inverse_rate, inverse_steps, inverse_minibatch: Learning rate, gradient steps per series and minibatch of the
            inverse dynamics.
        inverse_series: Largest number of series per update; the paper has one.
        inverse_error: Series end when the squared error of held-out transitions is below this share of the controls'
            variance.
    """

    learner: ClassVar[str] = "scenarionet_sim.learning.airl:AirlLearner"
    small: ClassVar[Mapping[str, Any]] = MappingProxyType(
        {**GailConfig.small, "inverse_rate": 1e-3, "inverse_series": 10}
    )

    discriminator_rate: float = 3e-4
    discriminator_epochs: int = 5
    inverse_rate: float = 1e-4
    inverse_steps: int = 100
    inverse_minibatch: int = 512
    inverse_series: int = 1
    inverse_error: float = 0.05


@dataclass(frozen=True)
class Td3Config(LearnerConfig):
    """TD3 with one replay of all agents' transitions; defaults of the appendix, then of Fujimoto et al. (2018).

    The replay is smaller than theirs.

    Attributes:
        replay: Largest number of transitions to keep.
        warm_up: Steps of agents with uniformly random actions before learning begins.
        minibatch: Transitions per update.
        updates: Updates per step of an agent; the original has 1.
        horizon: Steps of each world between two series of updates.
        noise: Standard deviation of the exploration noise.
        target_noise, target_clip: Standard deviation and limit of the noise of the target policy.
        delay: Updates of the critics per update of the policy and the targets.
        tau: Step of the targets towards the networks.
    """

    learner: ClassVar[str] = "scenarionet_sim.learning.td3:Td3Learner"
    small: ClassVar[Mapping[str, Any]] = MappingProxyType(
        {"worlds": 32, "seats": 16, "rate": 3e-4, "minibatch": 256, "reward_scale": 0.1, "updates": 0.1,
         "warm_up": 5_000, "noise": 0.3}
    )  # fmt: skip

    rate: Positive = 1e-4
    replay: Count = 100_000
    warm_up: int = 25_000
    minibatch: Count = 100
    updates: float = 1.0
    horizon: Count = 8
    noise: float = 0.1
    target_noise: float = 0.2
    target_clip: float = 0.5
    delay: Count = 2
    tau: float = 0.005


@dataclass(frozen=True)
class DaggerConfig(LearnerConfig):
    """Imitation of ``Guidance`` in the states that the learner itself comes to (DAgger, Ross et al. 2011).

    Attributes:
        horizon: Steps of each world between two series of updates.
        replay: Largest number of states to keep.
        minibatch, updates: States per update, and updates per round.
        share, half_life: Share of the rows that the teacher drives in the first round, and rounds until it has halved.
        spread: Initial deviation of the policy from the teacher, which is learned.
    """

    learner: ClassVar[str] = "scenarionet_sim.learning.dagger:DaggerLearner"
    observation: ClassVar[str] = "route"
    is_guided: ClassVar[bool] = True

    steps: Count = 800_000
    traffic: TrafficDriver = "idm"
    hidden: tuple[int, ...] = (256, 256)
    rate: Positive = 2e-3
    checkpoint_every: Count = 1000
    horizon: Count = 32
    replay: Count = 400_000
    minibatch: Count = 1024
    updates: Count = 24
    share: Share = 1.0
    half_life: Positive = 5.0
    spread: float = 0.1

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.bins:
            raise BadParameter(f"bins={self.bins}; dagger imitates continuous controls, expected 0")


ALGORITHMS: dict[str, str] = {
    "ppo": f"{__name__}:PpoConfig",
    "td3": f"{__name__}:Td3Config",
    "ippo": f"{__name__}:IppoConfig",
    "copo": f"{__name__}:CopoConfig",
    "gail": f"{__name__}:GailConfig",
    "airl": f"{__name__}:AirlConfig",
    "dagger": f"{__name__}:DaggerConfig",
}
"""Settings of each algorithm, as ``module:Class``."""


def config_class(algorithm: str) -> type[LearnerConfig]:
    """Return the class of the settings of an algorithm.

    Raises:
        BadParameter: It is neither a name in ALGORITHMS nor ``module:Class`` of settings.
    """
    if algorithm not in ALGORITHMS and ":" not in algorithm:
        names = ", ".join(ALGORITHMS)
        raise BadParameter(f"unknown algorithm {algorithm!r}; choose from {names}, or module:Class for your own")
    found = load_by_name(ALGORITHMS.get(algorithm, algorithm))
    if not (isinstance(found, type) and issubclass(found, LearnerConfig) and hasattr(found, "learner")):
        raise BadParameter(f"algorithm {algorithm}: expected a subclass of LearnerConfig that names its learner")
    return found


def make_learner_config(
    algorithm: str, size: str = "paper", settings: Mapping[str, Any] | None = None
) -> LearnerConfig:
    """Return the settings of an algorithm.

    Args:
        algorithm: A name in ALGORITHMS, or ``module:Class`` of settings of your own.
        size: ``paper`` for the published values, ``small`` for one processor core.
        settings: Fields that differ; texts are parsed.

    Raises:
        BadParameter: The algorithm, the size or a field is unknown, or a value is not of the field's type.
    """
    if size not in ("paper", "small"):
        raise BadParameter(f"size={size!r}; expected paper or small")
    kind = config_class(algorithm)
    given = parse_texts(kind, algorithm, settings or {})
    return kind(**((dict(kind.small) if size == "small" else {}) | given))


def describe_config(config: LearnerConfig) -> dict[str, Any]:
    """Return the fields of a configuration, JSON-serialisable."""
    return {name: list(value) if isinstance(value, tuple) else value for name, value in asdict(config).items()}
