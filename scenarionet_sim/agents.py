"""The agents of W worlds: who drives by actions, and what they touch."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scenarionet_data.arrays.compiled import unchecked
from scenarionet_data.arrays.dtypes import Bool, Float64, Int32, UInt8, UInt32
from scenarionet_sim.kernels.episodes import list_agents, place_among, schedule
from scenarionet_sim.kernels.step_arrays import DrivenArrays
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world import World
from scenarionet_sim.worlds.world_batch import WorldBatch


class PresentAgents:
    """The present agents, in the order of their worlds and rows, with room for their actions and contacts.

    Args:
        is_agent: (256,) policies whose objects are agents.
        num_worlds: W.
        are_egos: The agents are the egos instead, which policies drive; their locations on paths are kept here.

    Attributes:
        are_egos: As above.
        rows: (A, 2) int32 world and row of each.
        first: (W + 1,) int32 first agent of each world.
        actions: (A, 2) float64 of the last step.
        contacts: (A, N) bool objects that each agent's box overlaps, and ``contacts_before`` in the step before.
        hits: (A,) uint32 types of those objects: bit k is set for type k.
        awaits: (W,) worlds in which an agent is absent that may still appear.
        is_due: Whether there is one.
    """

    def __init__(self, is_agent: Bool, num_worlds: int, *, are_egos: bool) -> None:
        self._is_agent, self.are_egos = is_agent, are_egos
        self._own_route, self._own_route_before = np.zeros((2, 0, 0, 2))
        self.rows: Int32 = np.zeros((0, 2), np.int32)
        self.first: Int32 = np.zeros(num_worlds + 1, np.int32)
        self._listed_rows: Int32 = np.empty((0, 2), np.int32)
        self.awaits: Bool = np.zeros(num_worlds, np.bool_)
        self.is_due = False
        self._allocate(self.rows, 0)

    def drives(self, driver: UInt8) -> Bool:
        """Return the objects (W, N) that are agents, present or not, by the policy of each."""
        agents: Bool = self._is_agent[driver]
        return agents

    def among(self, world: World, driver: UInt8) -> Bool:
        """Return which objects (N,) of a world are agents, by the policy of each."""
        return np.arange(world.num_objects) == world.ego if self.are_egos else self.drives(driver)

    def route(self, state: State) -> Float64:
        """Return the location (W, N, 2) of the agents on their paths."""
        return self._own_route if self.are_egos else state.route

    def make_room(self, batch: WorldBatch) -> None:
        """Make room for the locations of the egos of the largest world."""
        if self.are_egos:
            self._own_route = _wider(self._own_route, batch)
            self._own_route_before = _wider(self._own_route_before, batch)

    def schedule(self, slots: Sequence[int], start: int | None, begins: Int32, batch: WorldBatch) -> bool:
        """Let episodes begin in some slots in the next step.

        Args:
            slots: The slots.
            start: Timestep of the logs; None for the first with a valid ego.
            begins: (W,) see ``StepArrays``; written.
            batch: The worlds.

        Returns:
            Whether the slots have as many agents as before. Then the step lists them in the rows of those before;
            otherwise see :meth:`update`.
        """
        places = np.array(slots, np.int64), -1 if start is None else start, batch.place, self.first
        is_same, self.is_due = unchecked(schedule)(*places, begins, self.awaits)
        if not is_same or self.contacts.shape[1] != batch.max_objects:
            return False
        self.rows = self.rows.copy()
        return True

    def update(self, driver: UInt8, present: Bool, batch: WorldBatch) -> bool:
        """List the present agents; those that were present before keep their actions and contacts.

        Args:
            driver: (W, N) policy of each object.
            present: (W, N) present objects.
            batch: The worlds.

        Returns:
            Whether room was made for other agents.
        """
        rows, is_other, is_resized = self._listed(driver, present, batch)
        if not is_resized and self.contacts.shape[1] == batch.max_objects:
            if is_other:
                self.rows = rows.copy()  # in worlds that begin an episode
            return False
        old, contacts, before = self.rows, self.contacts, self.contacts_before
        hits, actions, width = self.hits, self.actions, self.contacts.shape[1]
        self._allocate(rows.copy(), batch.max_objects)
        place = places(self.rows, old)
        here = np.flatnonzero(place >= 0)
        there = place[here]
        self.contacts[here, :width], self.contacts_before[here, :width] = contacts[there], before[there]
        self.hits[here], self.actions[here] = hits[there], actions[there]
        return True

    def arrays(self, before: State, now: State) -> DrivenArrays:
        """Return everything as kernels take it."""
        earlier = self._own_route_before if self.are_egos else before.route
        routes, contacts = (self.route(now), earlier), (self.contacts, self.contacts_before)
        return DrivenArrays(self._is_agent, self.rows, self.first, self.actions, *routes, *contacts, self.hits)

    def _listed(self, driver: UInt8, present: Bool, batch: WorldBatch) -> tuple[Int32, bool, bool]:
        """List world and row (A, 2) of each agent in memory that is used again; and update the first of each world.

        Returns:
            The list; whether it differs from that of before; whether a world has another number of agents.
        """
        if self.are_egos:
            self.first[:] = range(len(batch) + 1)
            rows = np.stack([self.first[:-1], batch.ego.astype(np.int32)], axis=1)
            return rows, not np.array_equal(rows, self.rows), len(rows) != len(self.rows)
        if len(self._listed_rows) != driver.size:
            self._listed_rows = np.empty((driver.size, 2), np.int32)
        is_other, is_resized = unchecked(list_agents)(
            batch.place, driver, present, self._is_agent, self.rows, self._listed_rows, self.first, self.awaits
        )
        self.is_due = bool(self.awaits.any())
        return self._listed_rows[: self.first[-1]], is_other, is_resized

    def _allocate(self, rows: Int32, num_objects: int) -> None:
        self.rows, count = rows, len(rows)
        self.actions: Float64 = np.zeros((count, 2))
        self.contacts: Bool = np.zeros((count, num_objects), np.bool_)
        self.contacts_before: Bool = self.contacts.copy()
        self.hits: UInt32 = np.zeros(count, np.uint32)


def _wider(route: Float64, batch: WorldBatch) -> Float64:
    """Return locations (W, N, 2) with room for the largest world; NaN where they are not known."""
    if route.shape[1] == batch.max_objects:
        return route
    wider = np.full((len(batch), batch.max_objects, 2), np.nan)
    wider[: len(route), : route.shape[1]] = route
    return wider


def places(rows: Int32, others: Int32) -> Int32:
    """Return where agents (A, 2) are in another list of agents (B, 2), -1 for nowhere; both are sorted."""
    found = np.empty(len(rows), np.int32)
    unchecked(place_among)(rows, others, found)
    return found
