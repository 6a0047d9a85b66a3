"""Configurations of environments: frozen, picklable dataclasses of parts that are configurations themselves."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from inspect import Parameter, signature
from types import MappingProxyType
from typing import Any, Literal, TypeVar

from scenarionet_data.arrays.dtypes import Bool, is_count
from scenarionet_data.errors import BadParameter
from scenarionet_sim.backends.base import Backend
from scenarionet_sim.backends.kinematic import Kinematic
from scenarionet_sim.policies.base import Policy
from scenarionet_sim.policies.external import External
from scenarionet_sim.policies.objects import vehicles
from scenarionet_sim.policies.replay import Replay
from scenarionet_sim.policies.route_sight import RouteTraffic
from scenarionet_sim.scenarios.selection import Scenarios
from scenarionet_sim.sensors.base import Sensor
from scenarionet_sim.sensors.lidar import Lidar
from scenarionet_sim.sensors.line_rays import BoundaryDetector
from scenarionet_sim.sensors.navigation import LightAhead, Navigation
from scenarionet_sim.sensors.state import EgoState
from scenarionet_sim.sensors.surrounding import Surrounding
from scenarionet_sim.task.task import MULTI_AGENT, SINGLE_AGENT, Reward, Termination
from scenarionet_sim.worlds.world import STEP, World

Environment = TypeVar("Environment", bound=type)

PAPER_OBSERVATION: tuple[Sensor, ...] = (Lidar(rays=120), EgoState(), Navigation(points=10, spacing=2.0))
"""Sensors of the ScenarioNet paper: 120 lidar rays over 50 m, ego state, 10 route points at 2 m spacing."""

ROUTE_OBSERVATION: tuple[Sensor, ...] = (
    EgoState(),
    Navigation(points=10, spacing=2.0),
    Navigation(points=10, spacing=8.0, range=80.0),
    LightAhead(range=80.0),
    LightAhead(range=20.0),
    RouteTraffic(),
    RouteTraffic(margin=0.8),
    RouteTraffic(range=15.0),  # braking goes with the square of 1 / gap
    Surrounding(objects=8),
)
"""True states of the traffic on the route and around, and the route over 80 m."""

OBSERVATIONS: Mapping[str, tuple[Sensor, ...]] = MappingProxyType(
    {"paper": PAPER_OBSERVATION, "route": ROUTE_OBSERVATION}
)
"""Observations that learners' settings name."""

BOUNDARY: tuple[Sensor, ...] = (BoundaryDetector(rays=12, range=50.0),)
"""The paper's optional boundary detector: 12 rays over 50 m."""


_PARTS: tuple[tuple[str, type[Any], str], ...] = (
    ("policies", Policy, "(Replay(), Idm(), External())"),
    ("backend", Backend, "Kinematic()"),
    ("sensors", Sensor, "(Camera(), EgoState())"),
    ("reward", Reward, "Reward(arrived=20.0)"),
    ("termination", Termination, "Termination(extra_steps=100)"),
)
"""Name, class and an example of the settings that are objects, or several."""


def travelling_vehicles(world: World) -> Bool:
    """Select vehicles with a route to drive; parked ones are replayed."""
    return vehicles(world) & (world.paths.length() >= MULTI_AGENT[1].short_route)


@dataclass(frozen=True)
class EnvConfig:
    """Configuration of an environment, except its seed and render mode.

    Attributes:
        scenarios: Scenarios to play.
        policies: Policies in rising priority: an object is driven by the last one that selects it. Objects of
            ``External`` are the agents. Single-agent environments evaluate the ego also if another policy drives it,
            such as ``Idm(objects=ego)``; actions are ignored then.
        backend: Vehicle dynamics of the agents.
        sensors: Sensors of each agent, or a name in OBSERVATIONS.
        observation: ``flat`` for one vector of all sensors in order, ``dict`` for one array per sensor name.
        reward: Weights of the reward.
        termination: Conditions that end an episode.
        dt: Timestep [s]; recordings at other times are resampled to it.
        prefetch: Scenarios to load ahead in a background thread; 0 loads them in ``reset``.
        cache_size: Number of worlds to keep in memory.
    """

    scenarios: Scenarios
    policies: tuple[Policy, ...] = (Replay(), External())
    backend: Backend = field(default_factory=Kinematic)
    sensors: tuple[Sensor, ...] = PAPER_OBSERVATION
    observation: Literal["flat", "dict"] = "flat"
    reward: Reward = SINGLE_AGENT[0]
    termination: Termination = SINGLE_AGENT[1]
    dt: float = STEP
    prefetch: int = 1
    cache_size: int = 32

    def __post_init__(self) -> None:
        if not isinstance(self.scenarios, Scenarios):
            raise BadParameter(f"scenarios={self.scenarios!r}; expected Scenarios('lake', 'database')")
        if self.observation not in ("flat", "dict"):
            raise BadParameter(f"observation={self.observation!r}; expected 'flat' or 'dict'")
        if not isinstance(self.dt, int | float) or not 0.0 < self.dt < 10.0:
            raise BadParameter(f"dt={self.dt!r}; expected a timestep in seconds, for example {STEP}")
        if not is_count(self.prefetch):
            raise BadParameter(f"prefetch={self.prefetch!r}; expected a number of scenarios to load ahead, or 0")
        for name, kind, example in _PARTS:
            value = getattr(self, name)
            if name == "sensors" and isinstance(value, str):
                if value not in OBSERVATIONS:
                    raise BadParameter(f"sensors={value!r}; expected {' or '.join(OBSERVATIONS)}, or your own")
                object.__setattr__(self, name, value := OBSERVATIONS[value])
            if isinstance(value, Sensor | Policy):
                object.__setattr__(self, name, (value,))
            parts = value if isinstance(value, tuple | list) else (value,)
            if any(isinstance(part, type) or not isinstance(part, kind) for part in parts):
                raise BadParameter(f"{name}={value!r}; expected, for example, {name}={example}")
        if not self.sensors:
            raise BadParameter("sensors is empty; an agent needs at least one sensor")

    def __repr__(self) -> str:
        drivers = ", ".join(type(policy).__name__ for policy in self.policies)
        sensors = ", ".join(type(sensor).__name__ for sensor in self.sensors)
        backend = type(self.backend).__name__
        return f"{type(self).__name__}({self.scenarios!r}, policies: {drivers}; {backend}; sensors: {sensors})"


@dataclass(frozen=True, repr=False)
class VectorConfig(EnvConfig):
    """``EnvConfig`` of many worlds that step together.

    Attributes:
        threads: Largest number of threads over worlds; 0 for all cores that the process may use.
    """

    threads: int = 0


@dataclass(frozen=True, repr=False)
class MultiAgentConfig(EnvConfig):
    """``EnvConfig`` in which every travelling vehicle is an agent, with the paper's multi-agent task."""

    policies: tuple[Policy, ...] = (Replay(), External(objects=travelling_vehicles))
    backend: Backend = field(default_factory=Kinematic)
    reward: Reward = MULTI_AGENT[0]
    termination: Termination = MULTI_AGENT[1]


def with_settings(kind: type[Any]) -> Callable[[Environment], Environment]:
    """Show the fields of a configuration in the signature of an environment, to completion and ``help``."""

    def decorate(environment: Environment) -> Environment:
        plain = signature(environment)
        own = [each for each in plain.parameters.values() if each.kind is not Parameter.VAR_KEYWORD]
        settings = [each.replace(kind=Parameter.KEYWORD_ONLY) for each in signature(kind).parameters.values()]
        environment.__signature__ = plain.replace(parameters=[*own, *settings])  # type: ignore[attr-defined]
        return environment

    return decorate


def make_config(kind: type[Any], config: EnvConfig | None, settings: dict[str, Any]) -> Any:
    """Return a configuration given as a whole or as its fields.

    Raises:
        BadParameter: Both or neither are given, or something else.
        TypeError: A field is unknown.
    """
    if config is not None and settings:
        raise BadParameter(f"pass config or its fields, not both; found config and {', '.join(settings)}")
    if config is not None and not isinstance(config, kind):
        hint = "; pass scenarios=Scenarios('lake', 'database')" if isinstance(config, Scenarios | str) else ""
        raise BadParameter(f"config={config!r}; expected a {kind.__name__}{hint}")
    if isinstance(given := settings.get("scenarios"), Mapping):  # of a specification that was JSON
        settings = settings | {"scenarios": Scenarios(**given)}
    if config is None and "scenarios" not in settings:
        raise BadParameter("an environment needs scenarios=Scenarios('lake', 'database')")
    fields = kind.__dataclass_fields__
    unknown = [name for name in settings if name not in fields]
    if unknown:
        raise TypeError(f"unknown setting {unknown[0]!r}; {kind.__name__} has {', '.join(fields)}")
    return kind(**settings) if config is None else config
