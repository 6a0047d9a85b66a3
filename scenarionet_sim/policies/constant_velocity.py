"""Constant velocity, the simplest baseline."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from scenarionet_sim.policies.base import Policy
from scenarionet_sim.policies.motion_kernels import CARRY_ON


@dataclass(frozen=True)
class ConstantVelocity(Policy):
    """Objects keep the velocity and heading at which they appear, and never leave."""

    movement: ClassVar[int] = CARRY_ON
