"""Base class of policies: they write the next state of the objects they drive, from the current state of all."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64, UInt8
from scenarionet_data.errors import BadParameter
from scenarionet_data.scenario.settings import check_settings
from scenarionet_sim.policies.motion_kernels import UNCOMPILED
from scenarionet_sim.policies.objects import ObjectMask, all_objects
from scenarionet_sim.worlds.lane_routes import LaneRoute
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world import World
from scenarionet_sim.worlds.world_batch import WorldBatch


@dataclass(frozen=True)
class Policy:
    """Drives some objects of every world.

    The package's own policies are part of the compiled step (``movement``, ``law``); a policy of your own implements
    :meth:`advance`, which is called in every step.

    Attributes:
        objects: Selects the objects, as a function of a world that returns a mask (N,).
        route: A route along the lanes of the map, instead of the recorded path, for policies that follow one.
    """

    movement: ClassVar[int] = UNCOMPILED
    """How the compiled step moves its objects: a constant of ``policies.motion_kernels``."""

    objects: ObjectMask = all_objects
    route: LaneRoute | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        if not callable(self.objects):
            raise BadParameter(f"objects={self.objects!r}; expected a function of a world, such as ego or vehicles")
        if not isinstance(self.route, LaneRoute | None):
            raise BadParameter(f"route={self.route!r}; expected LaneRoute(goal), or None for the recorded path")
        check_settings(self)

    def selects(self, world: World) -> Bool:
        """Return the mask (N,) of objects it drives, unless a later policy selects them too."""
        return self.objects(world)

    def sampled(self, rng: np.random.Generator) -> Policy:
        """Return the policy of one episode; a stochastic policy draws its parameters."""
        del rng
        return self

    def prepare(self, world: World, driven: Bool) -> World:
        """Return the world as this policy needs it; ``driven`` (N,) are the objects it drives."""
        return world if self.route is None else self.route.applied(world, driven)

    @property
    def together(self) -> Hashable:
        """What policies have in common whose objects one call of :meth:`advance` moves, in several worlds."""
        return self

    @property
    def history(self) -> int:
        """Number of past moments that it needs in ``State.history``."""
        return 0

    @property
    def law(self) -> Float64:
        """(8,) numbers of a ``policies.idm_kernels.Law`` for ``policies.motion_kernels.FOLLOW_PATH``."""
        return np.zeros(8)

    def begin(self, batch: WorldBatch, state: State, slot: int) -> None:
        """Prepare for an episode that begins in a slot; called unless the policy is part of the compiled step.

        Args:
            batch: Maps, logs and paths of the worlds.
            state: State at the beginning of the episode.
            slot: The slot.
        """

    def advance(self, batch: WorldBatch, now: State, then: State, driver: UInt8, policy_id: int, dt: float) -> None:
        """Write the next state of its objects.

        All policies read the same current state, so their order does not matter.

        Args:
            batch: Maps, logs and paths of the worlds.
            now: Current state.
            then: Next state, initially a copy of ``now``; write only the rows that this policy drives.
            driver: (W, N) uint8 policy of each object.
            policy_id: Number of this policy in ``driver``.
            dt: Length of the step [s].

        Raises:
            NotImplementedError: The policy is part of the compiled step.
        """
        raise NotImplementedError(
            f"{type(self).__name__} is part of the compiled step; override advance() to replace it"
        )


def is_compiled(policy: Policy) -> bool:
    """Return whether the compiled step moves a policy's objects."""
    return policy.movement != UNCOMPILED and type(policy).advance is Policy.advance
