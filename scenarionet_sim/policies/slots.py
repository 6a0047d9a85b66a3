"""The policies of W slots: an episode keeps those that were set when it began."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64, IntP, UInt8
from scenarionet_data.errors import BadParameter
from scenarionet_data.scenario.vocabulary import LIGHT_COLORS
from scenarionet_sim.policies.base import Policy, is_compiled
from scenarionet_sim.policies.external import External
from scenarionet_sim.policies.motion_kernels import FOLLOW_PATH, UNCOMPILED
from scenarionet_sim.policies.traffic import Traffic
from scenarionet_sim.worlds.episode_kernels import UNDRIVEN
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world import World
from scenarionet_sim.worlds.world_batch import WorldBatch

Policies = tuple[Policy, ...]
"""Policies in rising priority: an object is driven by the last one that selects it."""


class SlotPolicies:
    """The policies of W slots.

    Args:
        policies: Of the first episodes.
        num_slots: W.

    Attributes:
        of_next: Policies of the episodes that begin next.
        are_compiled: Whether the compiled step moves the objects of all policies.
        follow_paths: Whether one of them drives along paths there.
        are_replaced: Whether other policies than the first ones were set.
    """

    def __init__(self, policies: Policies, num_slots: int) -> None:
        self.of_next = policies
        self._playing = [policies] * num_slots
        movement = [policy.movement if is_compiled(policy) else UNCOMPILED for policy in policies]
        self.are_compiled, self.follow_paths = UNCOMPILED not in movement, FOLLOW_PATH in movement
        self._movement: UInt8 = np.array(movement, np.uint8)
        self._next_law, self.are_replaced = _laws(policies), False
        self._law = np.repeat(self._next_law[None], num_slots, axis=0)

    def replace(self, policies: Policies) -> None:
        """Set the policies of the episodes that begin next.

        Raises:
            BadParameter: They are of other kinds than those of the first episodes.
        """
        kinds, expected = list(map(type, policies)), list(map(type, self.of_next))
        if kinds != expected:
            raise BadParameter(f"policies of the kinds {kinds} in a simulation of {expected}; make a new simulation")
        if policies != self.of_next:  # worlds are prepared once for the same tuple
            self.of_next, self._next_law, self.are_replaced = policies, _laws(policies), True

    @property
    def are_external(self) -> Bool:
        """(256,) which policies drive by actions, by their number."""
        external: Bool = np.zeros(256, np.bool_)
        external[[number for number, policy in enumerate(self.of_next) if isinstance(policy, External)]] = True
        return external

    def begin(self, slots: Sequence[int] | IntP) -> None:
        """Let episodes that begin in some slots have the next policies."""
        if self.are_replaced:
            for slot in slots:
                self._playing[slot], self._law[slot] = self.of_next, self._next_law

    def begin_uncompiled(self, batch: WorldBatch, state: State, slot: int) -> None:
        """Prepare the policies outside of the compiled step for an episode that begins in a slot."""
        for policy in self._playing[slot]:
            if not is_compiled(policy):
                policy.begin(batch, state, slot)

    def traffic(self, driver: UInt8) -> Traffic:
        """Return what the compiled step needs to move the objects; ``driver`` (W, N) is the policy of each."""
        return Traffic(driver, self._movement, self._law, LIGHT_COLORS)

    def advance_uncompiled(self, batch: WorldBatch, now: State, then: State, driver: UInt8, dt: float) -> None:
        """Write the next state of the objects of policies outside of the compiled step; see ``Policy.advance``."""
        for number in np.flatnonzero(self._movement == UNCOMPILED).tolist():
            playing = [policies[number] for policies in self._playing]
            for together, policy in {each.together: each for each in playing}.items():
                rows = np.array([other.together == together for other in playing])
                here = driver if rows.all() else np.where(rows[:, None], driver, np.uint8(UNDRIVEN))
                policy.advance(batch, now, then, here, number, dt)


def prepared(world: World, policies: Policies) -> tuple[World, UInt8]:
    """Return a world as policies need it, and the policy of each object (N,)."""
    driver = np.full(world.num_objects, UNDRIVEN, np.uint8)
    for number, policy in enumerate(policies):
        driver[policy.selects(world)] = number
    for number, policy in enumerate(policies):
        world = policy.prepare(world, driver == number)
    return world, driver


def _laws(policies: Policies) -> Float64:
    """Return the numbers (P, 8) of the policies' driver models."""
    return np.array([policy.law for policy in policies]).reshape(-1, 8)
