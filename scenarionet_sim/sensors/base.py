"""Base class of sensors: frozen, picklable specifications that write the observations of A agents into an array.

An agent is a world and a row of it. Unless a sensor says otherwise, observations are in the agent's frame, x forward
and y left from the centre of its box. Sensors keep no state between calls; noise comes from the generator passed in.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from enum import IntEnum
from functools import lru_cache
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Bool, Float32, Float64, Int32
from scenarionet_data.errors import BadParameter, MissingDependency
from scenarionet_data.scenario.settings import check_settings
from scenarionet_data.scenario.vocabulary import MapFeatureType, ObjectType
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world_batch import WorldBatch

if TYPE_CHECKING:
    from gymnasium.spaces import Box


OBJECT_TYPES = 256
"""Length of lookup tables by type code."""


class Sensor(ABC):
    """Base class of sensors; subclasses are frozen dataclasses.

    Attributes:
        low, high: Bounds of every observed value.
        dtype: Type of the values.
    """

    low: ClassVar[float] = 0.0
    high: ClassVar[float] = 1.0
    dtype: ClassVar[type[np.generic]] = np.float32

    def __post_init__(self) -> None:
        check_settings(self)

    @property
    @abstractmethod
    def shape(self) -> tuple[int, ...]:
        """Shape of one agent's observation."""

    @abstractmethod
    def observe(self, batch: WorldBatch, state: State, agents: Int32, rng: np.random.Generator, out: Array) -> Array:
        """Write the observations of agents.

        Args:
            batch: The worlds' maps, logs and paths.
            state: Current state of all objects.
            agents: (A, 2) int32 world and row of each agent.
            rng: Source of noise; unused by a sensor without noise.
            out: (A, *shape) C-contiguous output of the sensor's dtype.

        Returns:
            ``out``.
        """

    def space(self) -> Box:
        """Return the Gymnasium space of one agent's observation.

        Raises:
            MissingDependency: Gymnasium is not installed.
        """
        try:
            from gymnasium.spaces import Box
        except ImportError as error:
            raise MissingDependency("spaces need gymnasium", "sim") from error
        return Box(self.low, self.high, self.shape, self.dtype)  # type: ignore[arg-type]  # accepts NumPy types

    def empty(self, num_agents: int) -> Array:
        """Return an output array (A, *shape) of zeros."""
        return np.zeros((num_agents, *self.shape), self.dtype)


def require_located(lost: int, agents: Int32) -> None:
    """Raise if an agent is not located on its path.

    Args:
        lost: Index of the agent, or -1; see ``sensors.route_kernels``.
        agents: (A, 2) world and row.

    Raises:
        BadParameter: ``lost`` is an agent.
    """
    if lost >= 0:
        raise BadParameter(
            f"object {agents[lost, 1]} of world {agents[lost, 0]} is not located on its path; a simulation locates "
            "its agents, call worlds.path_kernels.follow_paths for other objects"
        )


def require(is_met: bool, message: str) -> None:
    """Raise unless a condition on a sensor's parameters is met.

    Raises:
        BadParameter: The condition is not met.
    """
    if not is_met:
        raise BadParameter(message)


@lru_cache
def table(types: tuple[IntEnum, ...] | None) -> Bool:
    """Return (256,) bool by type code: True for the given types, or for all if None."""
    chosen = np.full(OBJECT_TYPES, types is None)
    chosen[[*(types or ())]] = True
    chosen.flags.writeable = False
    return chosen


def visible_objects(state: State, types: tuple[ObjectType, ...] | None) -> Bool:
    """Return (W, N) the present objects of the given types, or of all types if None."""
    return state.present if types is None else state.present & table(types)[state.object_type]


@lru_cache
def directions(count: int) -> Float64:
    """Return (count, 2) unit vectors at angles 2 pi k / count from straight ahead, counter-clockwise."""
    angles = np.arange(count) * (2.0 * np.pi / count)
    vectors = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    vectors.flags.writeable = False
    return vectors


def add_noise(shares: Float32, spread: float, dropout: float, rng: np.random.Generator) -> None:
    """Add noise to ranges in place.

    Args:
        shares: Ranges divided by the sensor's range, in [0, 1].
        spread: Standard deviation of the Gaussian error, divided by the range; results are clipped to [0, 1].
        dropout: Probability that a ray has no return.
        rng: Source of noise; unused when both are 0.
    """
    if spread > 0.0:
        shares += spread * rng.standard_normal(shares.shape, np.float32)
        np.clip(shares, 0.0, 1.0, out=shares)
    if dropout > 0.0:
        shares[rng.random(shares.shape, np.float32) < dropout] = 1.0


def map_types(is_kind: Callable[[Any], Any]) -> tuple[MapFeatureType, ...]:
    """Return the map feature types that satisfy a predicate such as ``is_road_edge``."""
    return tuple(member for member in MapFeatureType if is_kind(member))
