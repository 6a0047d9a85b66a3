"""Selections of the objects a policy drives: functions of a world that return a mask (N,)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Bool
from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_sim.worlds.world import World

ObjectMask = Callable[[World], Bool]
"""Maps a world to a mask (N,) bool over its objects."""


def all_objects(world: World) -> Bool:
    """Select every object."""
    return np.ones(world.num_objects, np.bool_)


def ego(world: World) -> Bool:
    """Select the recording vehicle."""
    is_ego: Bool = np.arange(world.num_objects) == world.ego
    return is_ego


def others(world: World) -> Bool:
    """Select every object except the ego."""
    return ~ego(world)


def vehicles(world: World) -> Bool:
    """Select every vehicle, including the ego."""
    is_vehicle: Bool = world.object_type == ObjectType.VEHICLE
    return is_vehicle


def other_vehicles(world: World) -> Bool:
    """Select every vehicle except the ego."""
    return vehicles(world) & others(world)


@dataclass(frozen=True)
class OfType:
    """Select objects of some types, except the ego."""

    types: tuple[ObjectType, ...]

    def __call__(self, world: World) -> Bool:
        """Return the mask (N,)."""
        return np.isin(world.object_type, self.types) & others(world)


@dataclass(frozen=True)
class TrackIds:
    """Select objects by track id."""

    ids: tuple[str, ...]

    def __call__(self, world: World) -> Bool:
        """Return the mask (N,)."""
        return np.isin(world.track_ids.astype(str), self.ids)
