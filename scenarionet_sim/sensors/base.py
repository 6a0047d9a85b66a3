"""What a sensor is: a frozen specification that pickles, and writes what A agents observe into an array.

An agent is a world and a row of it. Frames of what is observed are the agent's, x forward and y left, from its box's
centre, unless a sensor says otherwise. Nothing is remembered between calls; noise comes from the generator that is
handed in.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from enum import IntEnum
from functools import lru_cache
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Bool, Float64, Int32
from scenarionet_data.errors import BadParameter, MissingDependency
from scenarionet_data.scenario.vocabulary import MapFeatureType
from scenarionet_sim.kernels.route_observation import find_lost
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world_batch import WorldBatch

if TYPE_CHECKING:
    from gymnasium.spaces import Box


OBJECT_TYPES = 256
"""Length of tables by type code."""


class Sensor(ABC):
    """Observes agents; subclasses are frozen dataclasses.

    Attributes:
        low, high: Bounds of every number observed.
        dtype: Its type.
    """

    low: ClassVar[float] = 0.0
    high: ClassVar[float] = 1.0
    dtype: ClassVar[type[np.generic]] = np.float32

    @property
    @abstractmethod
    def shape(self) -> tuple[int, ...]:
        """Shape of what one agent observes."""

    @abstractmethod
    def observe(self, batch: WorldBatch, state: State, agents: Int32, rng: np.random.Generator, out: Array) -> Array:
        """Write what agents observe.

        Args:
            batch: The worlds.
            state: Where everything is now.
            agents: (A, 2) int32 world and row of each agent.
            rng: Where noise comes from; untouched by a sensor without noise.
            out: (A, ...) of the sensor's shape and dtype, C-contiguous, overwritten.

        Returns:
            ``out``.
        """

    def space(self) -> Box:
        """The Gymnasium space of what one agent observes.

        Raises:
            MissingDependency: Gymnasium is not installed.
        """
        try:
            from gymnasium.spaces import Box
        except ImportError as error:
            raise MissingDependency("spaces need gymnasium", "sim") from error
        return Box(self.low, self.high, self.shape, self.dtype)  # type: ignore[arg-type]  # a numpy type is meant

    def empty(self, num_agents: int) -> Array:
        """Room for what agents observe: (A, ...) zeros."""
        return np.zeros((num_agents, *self.shape), self.dtype)


def require_arcs(state: State, agents: Int32) -> None:
    """Refuse agents whose place on their paths is not known.

    Raises:
        BadParameter: Naming the first.
    """
    lost = find_lost(agents, state.arc)
    if lost >= 0:
        raise BadParameter(
            f"object {agents[lost, 1]} of world {agents[lost, 0]} has no place on its path; a simulation finds "
            "its agents', call kernels.paths.follow_paths for others"
        )


def require(is_met: bool, message: str) -> None:
    """Refuse a sensor's parameter.

    Raises:
        BadParameter: The requirement is not met.
    """
    if not is_met:
        raise BadParameter(message)


@lru_cache
def table(types: tuple[IntEnum, ...] | None) -> Bool:
    """(256,) bool by type code: True for these types, for all when None."""
    chosen = np.full(OBJECT_TYPES, types is None)
    chosen[[*(types or ())]] = True
    chosen.flags.writeable = False
    return chosen


@lru_cache
def directions(count: int) -> Float64:
    """(count, 2) unit vectors at angles 2 pi k / count from straight ahead, counter-clockwise."""
    angles = np.arange(count) * (2.0 * np.pi / count)
    vectors = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    vectors.flags.writeable = False
    return vectors


def map_types(is_kind: Callable[[Any], Any]) -> tuple[MapFeatureType, ...]:
    """The map features that a mask function such as ``is_road_edge`` takes."""
    return tuple(member for member in MapFeatureType if is_kind(member))
