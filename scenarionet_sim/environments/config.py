"""What an environment is made of: parts that are their own configuration, in one frozen value that pickles."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

from scenarionet_data.arrays.dtypes import Bool
from scenarionet_data.errors import BadParameter
from scenarionet_sim.backends.base import Backend
from scenarionet_sim.backends.bullet import Bullet
from scenarionet_sim.backends.kinematic import Kinematic
from scenarionet_sim.policies import External, Policy, Replay, vehicles
from scenarionet_sim.scenarios import Scenarios
from scenarionet_sim.sensors import BoundaryDetector, EgoState, Lidar, Navigation, Sensor
from scenarionet_sim.task.task import MULTI_AGENT, SINGLE_AGENT, Ending, Reward
from scenarionet_sim.worlds.world import World

PAPER_OBSERVATION: tuple[Sensor, ...] = (Lidar(rays=120), EgoState(), Navigation(points=10, spacing=2.0))
"""Lidar of 120 rays over 50 m, ego state, and 10 points 2 m apart along the reference trajectory."""

BOUNDARY: tuple[Sensor, ...] = (BoundaryDetector(rays=12, range=50.0),)
"""What the paper adds to the observation where the road's boundary matters."""


def travelling_vehicles(world: World) -> Bool:
    """Vehicles whose route is not complete from the beginning; parked ones stay where they were recorded."""
    return vehicles(world) & (world.paths.length() >= MULTI_AGENT[1].short_route)


@dataclass(frozen=True)
class EnvConfig:
    """Everything about an environment but its seed and its window.

    Attributes:
        scenarios: What is played.
        policies: Who drives what; the last that wants an object drives it. Agents are what ``External`` drives; in
            the single-agent environments the ego is judged whoever drives it, and actions are ignored if it is
            another policy, for example ``Idm(who=ego)``.
        backend: How agents move.
        sensors: What an agent observes.
        observation: ``flat``, one vector of all sensors in their order, or ``dict``, by the sensors' names.
        reward, ending: The task.
        ahead: Scenarios loaded ahead in a thread; 0 loads at the reset itself.
        keep: Worlds kept in memory.
    """

    scenarios: Scenarios
    policies: tuple[Policy, ...] = (Replay(), External())
    backend: Backend = field(default_factory=Bullet)
    sensors: tuple[Sensor, ...] = PAPER_OBSERVATION
    observation: Literal["flat", "dict"] = "flat"
    reward: Reward = SINGLE_AGENT[0]
    ending: Ending = SINGLE_AGENT[1]
    ahead: int = 1
    keep: int = 32

    def __post_init__(self) -> None:
        if not isinstance(self.scenarios, Scenarios):
            raise BadParameter(f"scenarios={self.scenarios!r}; wanted Scenarios('lake', 'database')")
        if self.observation not in ("flat", "dict"):
            raise BadParameter(f"observation {self.observation!r}; wanted flat or dict")
        if not self.sensors:
            raise BadParameter("an agent without sensors observes nothing; give at least one")


@dataclass(frozen=True)
class VectorConfig(EnvConfig):
    """As ``EnvConfig``, with the quick backend."""

    backend: Backend = field(default_factory=Kinematic)


@dataclass(frozen=True)
class MultiAgentConfig(EnvConfig):
    """As ``EnvConfig``, with every vehicle that goes anywhere an agent and the paper's multi-agent task."""

    policies: tuple[Policy, ...] = (Replay(), External(who=travelling_vehicles))
    backend: Backend = field(default_factory=Kinematic)
    reward: Reward = MULTI_AGENT[0]
    ending: Ending = MULTI_AGENT[1]


def configured(kind: type[Any], config: EnvConfig | None, settings: dict[str, Any]) -> Any:
    """A configuration given whole or by its fields.

    Raises:
        BadParameter: Both or neither are given, or a field is unknown.
    """
    if config is not None and settings:
        raise BadParameter(f"give config or its fields, not both; found {', '.join(settings)} beside config")
    if config is None and "scenarios" not in settings:
        raise BadParameter("an environment needs scenarios=Scenarios('lake', 'database')")
    known = kind.__dataclass_fields__
    unknown = [name for name in settings if name not in known]
    if unknown:
        raise BadParameter(f"no setting {unknown[0]!r}; there are {', '.join(known)}")
    return kind(**settings) if config is None else config
