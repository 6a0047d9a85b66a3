"""Collisions by what was hit; an object is hit once, however long it is touched."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenarionet_data.scenario import Bool, Codes
from scenarionet_data.vocabulary import ObjectType

_HUMANS = (ObjectType.PEDESTRIAN, ObjectType.CYCLIST)


@dataclass(frozen=True)
class Collisions:
    """What was hit in an episode.

    Attributes:
        vehicles, humans, objects: Vehicles; pedestrians and cyclists; everything else.
        first: Step of the first touch; None without any.
    """

    vehicles: int
    humans: int
    objects: int
    first: int | None

    @property
    def cost(self) -> int:
        """The paper's cost: the number of crashes."""
        return self.vehicles + self.humans + self.objects


def count_collisions(contacts: Bool, object_type: Codes) -> Collisions:
    """Collisions of one agent.

    Args:
        contacts: (T, N) whose box its box overlaps.
        object_type: (N,) codes of ``ObjectType``.
    """
    hit = object_type[contacts.any(axis=0)]
    vehicles, humans = int((hit == ObjectType.VEHICLE).sum()), int(np.isin(hit, _HUMANS).sum())
    touched = contacts.any(axis=1)
    first = int(touched.argmax()) if touched.any() else None
    return Collisions(vehicles, humans, len(hit) - vehicles - humans, first)
