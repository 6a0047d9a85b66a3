"""Collisions by the type of the object hit.

A crash begins in the step in which an agent touches an object that it did not touch in the step before; boxes that
overlap from the first moment on belong to the recording and do not count.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, UInt8
from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_sim.metrics.drive import DrivenEpisode

_HUMANS = (ObjectType.PEDESTRIAN, ObjectType.CYCLIST)


@dataclass(frozen=True)
class Collisions:
    """Collisions of an episode.

    Attributes:
        vehicles, humans, objects: Number of different vehicles, of pedestrians and cyclists, and of all other objects.
        cost: The paper's cost: number of crashes, possibly several with one object.
        first: Step of the first crash, or None.
    """

    vehicles: int
    humans: int
    objects: int
    cost: int
    first: int | None


def measure(episode: DrivenEpisode) -> dict[str, Any]:
    """Return the collisions of the whole episode."""
    found = count_collisions(episode.rollout.contacts, episode.world.object_type)
    return {
        "collided_vehicles": found.vehicles,
        "collided_humans": found.humans,
        "collided_objects": found.objects,
        "cost": found.cost,
        "first_collision": None if found.first is None else found.first * episode.rollout.dt,
    }


def count_collisions(contacts: Bool, object_type: UInt8) -> Collisions:
    """Count the collisions of one agent.

    Args:
        contacts: (T, N) objects that its box overlaps.
        object_type: (N,) codes of ``ObjectType``.
    """
    crashes = contacts[1:] > contacts[:-1]
    if not crashes.any():
        return Collisions(0, 0, 0, 0, None)
    hit = object_type[crashes.any(axis=0)]
    vehicles, humans = int((hit == ObjectType.VEHICLE).sum()), int(np.isin(hit, _HUMANS).sum())
    steps = np.flatnonzero(crashes.any(axis=1))
    first = int(steps[0]) + 1 if len(steps) else None
    return Collisions(vehicles, humans, len(hit) - vehicles - humans, int(crashes.sum()), first)
