"""Replay of the log, bit for bit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from scenarionet_sim.policies.base import Policy
from scenarionet_sim.policies.motion_kernels import REPLAY


@dataclass(frozen=True)
class Replay(Policy):
    """Objects follow their recorded states and are present only while those are valid.

    After the end of the log they are at rest.
    """

    movement: ClassVar[int] = REPLAY
