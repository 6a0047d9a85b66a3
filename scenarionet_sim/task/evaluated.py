"""Whom an environment judges: the agents of its simulation, or egos that a policy drives.

Both say where those are on their reference paths and what they touch, in the same attributes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from scenarionet_data.arrays.dtypes import Bool, Float64, Int32
from scenarionet_sim.kernels.overlap import find_contacts
from scenarionet_sim.kernels.paths import follow_paths
from scenarionet_sim.simulation import LOOK_AHEAD, LOOK_BACK, Simulation
from scenarionet_sim.worlds.state import State


class Agents:
    """The simulation's agents: nothing has to be found that it has not found itself."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation

    def begin(self, slot: int) -> None:
        """Nothing to forget."""

    def look(self) -> None:
        """Nothing to find."""

    @property
    def rows(self) -> Int32:
        """(A, 2) world and row of each."""
        return self._simulation.agents

    @property
    def state(self) -> State:
        """The moment."""
        return self._simulation.state

    @property
    def arc_before(self) -> Float64:
        """(W, N) ``State.arc`` of a step ago."""
        return self._simulation.previous.arc

    @property
    def contacts(self) -> Bool:
        """(A, N) what each touches."""
        return self._simulation.contacts

    @property
    def hits(self) -> npt.NDArray[np.uint32]:
        """(A,) the same by type, as bits."""
        return self._simulation.hits


class Egos:
    """The ego of every world, whoever drives it.

    Attributes:
        As of :class:`Agents`; ``state`` is the moment with the egos' places on their paths.
    """

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        worlds = len(simulation.batch)
        self.rows: Int32 = np.zeros((worlds, 2), np.int32)
        self.rows[:, 0] = np.arange(worlds)
        self.hits = np.zeros(worlds, np.uint32)
        self._arc = np.full((worlds, 0), np.nan)
        for slot in range(worlds):
            self.begin(slot)

    def begin(self, slot: int) -> None:
        """Look for a world's ego anew."""
        more = self._simulation.batch.max_objects - self._arc.shape[1]
        if more:
            self._arc = np.pad(self._arc, ((0, 0), (0, more)), constant_values=np.nan)
            self.arc_before = self._arc.copy()
            self._lateral, self._height = np.zeros_like(self._arc), np.zeros_like(self._arc)
            self.contacts = np.zeros(self._arc.shape, np.bool_)
        self.rows[slot, 1] = self._simulation.batch.ego[slot]
        self._arc[slot] = np.nan
        self.look()

    def look(self) -> None:
        """Find where the egos are now."""
        batch, state = self._simulation.batch, self._simulation.state
        self.arc_before[...] = self._arc
        paths = batch.path_points, batch.path_arc, batch.path_heading, batch.path_z, batch.path_offsets
        places = self._arc, self._lateral, self._height
        follow_paths(self.rows, state.position, *paths, LOOK_BACK, LOOK_AHEAD, *places)
        boxes = state.position, state.heading, state.z, state.size, state.object_type, state.present
        find_contacts(self.rows, *boxes, self.contacts, self.hits)

    @property
    def state(self) -> State:
        """The moment, with the egos' places on their paths."""
        return replace(self._simulation.state, arc=self._arc, lateral=self._lateral)
