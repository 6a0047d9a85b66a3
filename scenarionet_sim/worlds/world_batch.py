"""The worlds of W slots: which world of the pool each of them plays."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from scenarionet_data.arrays.dtypes import Float64, Int64
from scenarionet_sim.kernels.structures import EGO, NUM_OBJECTS, NUM_PLACES, NUM_STEPS, Lines, Recorded
from scenarionet_sim.worlds.pool import PooledWorld, WorldPool
from scenarionet_sim.worlds.world import World

if TYPE_CHECKING:
    from scenarionet_data.arrays.dtypes import Bool, UInt8
    from scenarionet_sim.worlds.pool import Prepare


def as_recorded(world: World, policies: Hashable) -> tuple[World, UInt8, Bool]:
    """Return a world unchanged, with the first policy for every object, and no agent."""
    del policies
    return world, np.zeros(world.num_objects, np.uint8), np.zeros(world.num_objects, np.bool_)


class WorldBatch:
    """The worlds of a simulation, one per slot.

    Args:
        worlds: One per slot; the same world may be in several.
        policies: Of the first episodes.
        prepare: Prepares each different world for its policies, see ``WorldPool``.
        keep: Number of worlds to keep that no slot plays.

    Attributes:
        worlds: The worlds as prepared, by slot.
        recorded, lines: Their arrays as kernels take them.
        place: (W, NUM_PLACES) see ``kernels.structures.Recorded``.
    """

    def __init__(
        self, worlds: Sequence[World], policies: Hashable = None, prepare: Prepare = as_recorded, keep: int = 32
    ) -> None:
        self.pool = WorldPool(prepare, keep)
        self.place: Int64 = np.zeros((len(worlds), NUM_PLACES), np.int64)
        self._frame: Float64 = np.zeros((len(worlds), 5))
        self._slots: list[PooledWorld] = []
        self.worlds: list[World] = []
        for slot, world in enumerate(worlds):
            self._slots.append(self.pool.claim(world, policies))
            self.worlds.append(self._slots[slot].world)
            self.place[slot], self._frame[slot] = self._slots[slot].place, self._slots[slot].frame
        self._collect()

    def __len__(self) -> int:
        return len(self.worlds)

    @property
    def max_objects(self) -> int:
        """Largest number of objects of any world so far."""
        return self.pool.max_objects

    @property
    def num_objects(self) -> Int64:
        """(W,) number of objects of each world."""
        return self.place[:, NUM_OBJECTS]

    @property
    def num_steps(self) -> Int64:
        """(W,) number of timesteps of each log."""
        return self.place[:, NUM_STEPS]

    @property
    def ego(self) -> Int64:
        """(W,) row of each ego."""
        return self.place[:, EGO]

    def replace(self, slots: Sequence[int], worlds: Sequence[World | None], policies: Hashable = None) -> None:
        """Put worlds into slots, or for None the same again, for episodes with some policies."""
        for slot, world in zip(slots, worlds, strict=True):
            old = self._slots[slot]
            self._slots[slot] = new = self.pool.claim(old.key[0] if world is None else world, policies)
            self.worlds[slot] = new.world
            self.place[slot], self._frame[slot] = new.place, new.frame
            self.pool.release(old)
        if self.pool.arrays is not self._arrays:
            self._collect()

    def _collect(self) -> None:
        self._arrays = self.pool.arrays
        arrays = self._arrays | {"place": self.place, "frame": self._frame}
        self.recorded = Recorded(**{name: arrays[name] for name in Recorded._fields})
        self.lines = Lines(**{name: arrays[name] for name in Lines._fields})
