"""Which objects of a world a policy drives: a function of the world, or your own, ``World`` to a mask (N,)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Bool
from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_sim.worlds.world import World

Who = Callable[[World], Bool]


def everyone(world: World) -> Bool:
    """Every object."""
    return np.ones(world.num_objects, np.bool_)


def ego(world: World) -> Bool:
    """The recording vehicle."""
    is_ego: Bool = np.arange(world.num_objects) == world.ego
    return is_ego


def others(world: World) -> Bool:
    """Every object but the ego."""
    return ~ego(world)


def vehicles(world: World) -> Bool:
    """Every vehicle, the ego too."""
    is_vehicle: Bool = world.object_type == ObjectType.VEHICLE
    return is_vehicle


def other_vehicles(world: World) -> Bool:
    """Every vehicle but the ego."""
    return vehicles(world) & others(world)


@dataclass(frozen=True)
class OfType:
    """Every object of these types, the ego left out."""

    types: tuple[ObjectType, ...]

    def __call__(self, world: World) -> Bool:
        """The mask (N,)."""
        return np.isin(world.object_type, self.types) & others(world)


@dataclass(frozen=True)
class Tracks:
    """The objects with these track ids."""

    ids: tuple[str, ...]

    def __call__(self, world: World) -> Bool:
        """The mask (N,)."""
        return np.isin(world.track_ids.astype(str), self.ids)
