"""Reactive traffic on recorded paths."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64
from scenarionet_data.scenario.settings import Positive
from scenarionet_sim.policies.base import Policy
from scenarionet_sim.policies.idm_kernels import Law
from scenarionet_sim.policies.motion_kernels import FOLLOW_PATH
from scenarionet_sim.policies.objects import ObjectMask, other_vehicles
from scenarionet_sim.worlds.world import World


@dataclass(frozen=True)
class Idm(Policy):
    """The Intelligent Driver Model (Treiber, Hennecke, Helbing 2000) along an object's recorded path.

    An object keeps a headway to every box on the strip ahead, including the ego, stops at red lights on the lanes of
    its path, slows down for bends, and leaves at the end of its path; the ego comfortably stops there and stays. It
    appears as recorded, once its place is free.
    Objects that were recorded standing are left to the preceding policy.

    Attributes:
        objects: Selects the objects; ``Idm(objects=ego)`` drives the ego.
        headway: Time gap to the object ahead [s].
        acceleration: Maximum acceleration [m/s²].
        deceleration: Comfortable deceleration [m/s²].
        standstill: Gap at rest [m].
        slowest: Least desired speed [m/s]; the desired speed is the highest recorded one.
        lateral: Lateral acceleration in bends [m/s²].
        overlap: Boxes that overlap the strip by less are ignored [m]: recorded boxes are not that exact.
        hardest: Emergency deceleration [m/s²].
        shortest: Objects with a shorter path count as standing [m].
    """

    movement: ClassVar[int] = FOLLOW_PATH

    objects: ObjectMask = other_vehicles
    headway: Positive = 1.5
    acceleration: Positive = 2.0
    deceleration: Positive = 3.0
    standstill: Positive = 2.0
    slowest: Positive = 5.0
    lateral: Positive = 3.0
    overlap: float = 0.3
    hardest: Positive = 8.0
    shortest: float = 2.0

    def selects(self, world: World) -> Bool:
        """Return the mask (N,) of its objects that drive at all."""
        return self.objects(world) & (world.paths.length() >= self.shortest)

    @property
    def law(self) -> Float64:
        """(8,) parameters of the driver model."""
        return np.array([getattr(self, name) for name in Law._fields], np.float64)
