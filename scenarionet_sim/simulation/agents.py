"""The agents of W worlds: what drives by actions, and what it touches."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scenarionet_data.arrays.dtypes import Array, Bool, Float64, Int32, IntP, UInt8, UInt32
from scenarionet_data.errors import BadParameter
from scenarionet_sim.backends.action_kernels import place_actions
from scenarionet_sim.backends.base import as_numbers
from scenarionet_sim.simulation.agent_kernels import DrivenArrays
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world import World
from scenarionet_sim.worlds.world_batch import WorldBatch


class DrivenAgents:
    """The agents, with room for their actions and contacts.

    Each agent has a place in its world until it leaves: place k of world w is number ``w * K + k`` of the C = W * K
    places, where K is the largest number of agents of any world so far. The compiled step gives the first free place
    of its world to an agent that appears.

    Args:
        is_agent: (256,) policies whose objects are agents.
        num_worlds: W.
        are_egos: The agents are the egos instead, which policies drive; their locations on paths are kept here.

    Attributes:
        are_egos: As above.
        actions: (C, 2) float64 of the last step, by place as the rest.
        contacts: (C, N) bool objects that each agent's box overlaps.
        hits: (C,) uint32 types of those objects: bit k is set for type k.
        row_at: (W, K) int32 row of the agent at each place; -1 at a free one.
    """

    def __init__(self, is_agent: Bool, num_worlds: int, *, are_egos: bool) -> None:
        self._is_agent, self.are_egos = is_agent, are_egos
        self._own_route, self._own_route_before = np.zeros((2, num_worlds, 0, 2))
        self.row_at: Int32 = np.empty((num_worlds, 0), np.int32)
        self._is_new: Bool = np.empty((num_worlds, 0), np.bool_)
        self._awaits: Bool = np.zeros(num_worlds, np.bool_)
        self.actions: Float64 = np.zeros((0, 2))
        self.contacts: Bool = np.zeros((0, 0), np.bool_)
        self._contacts_before: Bool = np.zeros((0, 0), np.bool_)
        self.hits: UInt32 = np.zeros(0, np.uint32)
        self._listed_for: Int32 = np.empty(0, np.int32)  # ``row_at`` when the agents were listed
        self._is_listed = False

    @property
    def num_places(self) -> int:
        """C."""
        return self.row_at.size

    @property
    def rows(self) -> Int32:
        """(A, 2) world and row of each agent, sorted; the same array as long as these are the same."""
        self._list()
        return self._rows

    @property
    def places(self) -> IntP:
        """(A,) place of each agent."""
        self._list()
        return self._places

    def forget_list(self) -> None:
        """List the agents anew when they are asked for, if some have appeared or left."""
        self._is_listed = False

    def among(self, world: World, driver: UInt8) -> Bool:
        """Return which objects (N,) of a world are agents, by the policy of each."""
        return np.arange(world.num_objects) == world.ego if self.are_egos else self._is_agent[driver]

    def route(self, state: State) -> Float64:
        """Return the location (W, N, 2) of the agents on their paths."""
        return self._own_route if self.are_egos else state.route

    def make_room(self, batch: WorldBatch) -> bool:
        """Make room for the agents of the largest worlds; return whether there are other places than before."""
        num_worlds, old = self.row_at.shape
        count, width = max(batch.max_agents, old), batch.max_objects
        if count == old and self.contacts.shape[1] == width:
            return False
        self._own_route, self._own_route_before = (
            _wider(values, (num_worlds, width if self.are_egos else 0, 2), np.nan)
            for values in (self._own_route, self._own_route_before)
        )
        self.row_at = _wider(self.row_at, (num_worlds, count), -1)
        self._is_new = _wider(self._is_new, (num_worlds, count), False)

        def wider(values: Array, *shape: int) -> Array:  # by place
            by_world = values.reshape(num_worlds, old, *values.shape[1:])
            return _wider(by_world, (num_worlds, count, *shape), 0).reshape(-1, *shape)

        self.actions, self.hits = wider(self.actions, 2), wider(self.hits)
        self.contacts, self._contacts_before = wider(self.contacts, width), wider(self._contacts_before, width)
        self.forget_list()
        return bool(count > old)

    def act(self, actions: npt.ArrayLike, num_given: int) -> None:
        """Set the actions of the next step, clipped to [-1, 1].

        Args:
            actions: (W * S, 2) steering and throttle for the first S places of each world; those for free places are
                ignored, and agents at other places get zeros.
            num_given: S.

        Raises:
            BadParameter: The actions have another shape, or that of an agent is not finite.
        """
        given = as_numbers(actions)
        if given.shape != (len(self.row_at) * num_given, 2):
            expected = len(self.row_at) * num_given
            count = len(given) if given.ndim else "no"
            raise BadParameter(f"{count} actions for {expected} agents; pass one per agent, shape ({expected}, 2)")
        invalid = place_actions(self.row_at, given, self.actions)
        if invalid >= 0:
            raise BadParameter(f"an action is not finite: {given[invalid].tolist()}")

    def remove(self, worlds: Int32, rows: Int32) -> None:
        """Free the places of agents (K,), by world and row."""
        agent, place = np.nonzero(self.row_at[worlds] == rows[:, None])
        self.row_at[worlds[agent], place] = -1
        self.forget_list()

    def remove_all(self, world: int) -> None:
        """Free all places of a world."""
        self.row_at[world], self._awaits[world] = -1, False
        self.forget_list()

    def arrays(self, before: State, now: State) -> DrivenArrays:
        """Return everything as kernels take it."""
        routes = (self._own_route, self._own_route_before) if self.are_egos else (now.route, before.route)
        return DrivenArrays(
            self._is_agent, self.row_at, self._is_new, self._awaits, *routes, self.contacts,
            self._contacts_before, self.hits,
        )  # fmt: skip

    def _list(self) -> None:
        """List world and row of each agent in their order, and the places, unless they are the same as last."""
        if not (self._is_listed or np.array_equal(self.row_at, self._listed_for)):
            worlds, place = np.nonzero(self.row_at >= 0)
            rows = self.row_at[worlds, place]
            order = np.lexsort((rows, worlds))
            self._rows: Int32 = np.stack([worlds, rows], axis=1)[order].astype(np.int32)
            self._places: IntP = (worlds * self.row_at.shape[1] + place)[order]
            self._listed_for = self.row_at.copy()
        self._is_listed = True


def _wider(values: Array, shape: tuple[int, ...], default: float) -> Array:
    """Return a copy with more columns, which have a default value."""
    wider = np.full(shape, default, values.dtype) if default else np.zeros(shape, values.dtype)
    wider[tuple(map(slice, values.shape))] = values
    return wider
