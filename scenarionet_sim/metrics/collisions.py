"""Collisions by what was hit.

A crash begins at the step at which an agent touches what it did not touch before; boxes that overlap from the first
moment on are the recording's own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, UInt8
from scenarionet_data.scenario.vocabulary import ObjectType

_HUMANS = (ObjectType.PEDESTRIAN, ObjectType.CYCLIST)


@dataclass(frozen=True)
class Collisions:
    """What was hit in an episode.

    Attributes:
        vehicles, humans, objects: How many different vehicles; pedestrians and cyclists; objects of every other type.
        cost: The paper's cost: the number of crashes, of which one object may suffer several.
        first: Step of the first crash; None without any.
    """

    vehicles: int
    humans: int
    objects: int
    cost: int
    first: int | None


def count_collisions(contacts: Bool, object_type: UInt8) -> Collisions:
    """Collisions of one agent.

    Args:
        contacts: (T, N) whose box its box overlaps.
        object_type: (N,) codes of ``ObjectType``.
    """
    crashes = contacts[1:] & ~contacts[:-1]
    hit = object_type[crashes.any(axis=0)]
    vehicles, humans = int((hit == ObjectType.VEHICLE).sum()), int(np.isin(hit, _HUMANS).sum())
    steps = np.flatnonzero(crashes.any(axis=1))
    first = int(steps[0]) + 1 if len(steps) else None
    return Collisions(vehicles, humans, len(hit) - vehicles - humans, int(crashes.sum()), first)
