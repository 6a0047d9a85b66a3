"""Selections of the objects a policy drives: functions of a world that return a mask (N,)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Bool
from scenarionet_data.scenario.settings import check_is
from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_sim.worlds.world import World

ObjectMask = Callable[[World], Bool]
"""Maps a world to a mask (N,) bool over its objects."""


def all_objects(world: World) -> Bool:
    """Select every object."""
    return np.ones(world.num_objects, np.bool_)


def ego(world: World) -> Bool:
    """Select the recording vehicle."""
    check_is("world", world, World, "World.from_scenario(scenario)")
    is_ego: Bool = np.arange(world.num_objects) == world.ego
    return is_ego


def others(world: World) -> Bool:
    """Select every object except the ego."""
    return ~ego(world)


def vehicles(world: World) -> Bool:
    """Select every vehicle, including the ego."""
    check_is("world", world, World, "World.from_scenario(scenario)")
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


def vehicles_behind_ego(world: World) -> Bool:
    """Select the vehicles that the paper's experiments let react: those behind the ego when they appear.

    They are more than 1 m behind its centre and less than 15 m aside, head within 90 degrees of its heading, and end
    more than 5 m from where they appear. Source: MetaDrive, ``ScenarioTrafficManager.get_traj_idm_policy`` and its
    constants ``IDM_CREATE_*``.
    """
    selected, positions = other_vehicles(world), world.log_position.astype(np.float64)
    for row in np.flatnonzero(selected):
        steps = np.flatnonzero(world.log_valid[:, row])
        if not len(steps):
            selected[row] = False
            continue
        first, last = steps[0], steps[-1]
        heading = float(world.log_heading[first, world.ego])
        from_ego = positions[first, row] - positions[first, world.ego]
        ahead = from_ego @ (np.cos(heading), np.sin(heading))
        aside = from_ego @ (-np.sin(heading), np.cos(heading))
        same_way = np.cos(float(world.log_heading[first, row]) - heading) > 0.0
        moved = np.hypot(*(positions[last, row] - positions[first, row]))
        selected[row] = ahead < -1.0 and abs(aside) < 15.0 and same_way and moved > 5.0
    return selected
