"""The worlds of W slots: which world of the pool each of them plays."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Int32, Int64, IntP
from scenarionet_sim.arrays.structures import (
    EGO,
    NUM_OBJECTS,
    NUM_PLACES,
    NUM_STEPS,
    SERIAL,
    Lines,
    Recorded,
    Series,
    Slots,
)
from scenarionet_sim.worlds.episode_kernels import play_scenarios
from scenarionet_sim.worlds.pool import WorldPool
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
        recorded, lines: Their arrays as kernels take them.
        place: (W, NUM_PLACES) see ``arrays.structures.Recorded``.
    """

    def __init__(
        self, worlds: Sequence[World], policies: Hashable = None, prepare: Prepare = as_recorded, keep: int = 32
    ) -> None:
        self.pool = WorldPool(prepare, keep)
        self.place: Int64 = np.zeros((len(worlds), NUM_PLACES), np.int64)
        self._slots = Slots(np.full(len(worlds), -1, np.int64), self.place, np.zeros((len(worlds), 10)))
        self._worlds: list[World] | None = None
        self._num_slots = len(worlds)
        self._arrays: dict[str, Array] = {}
        self.replace(range(len(worlds)), worlds, policies)

    def __len__(self) -> int:
        return self._num_slots

    @property
    def worlds(self) -> list[World]:
        """The worlds as prepared, by slot; a new list after some have changed."""
        if self._worlds is None:
            self._worlds = [self.pool.worlds[number].world for number in self._slots.number.tolist()]
        return self._worlds

    @property
    def max_objects(self) -> int:
        """Largest number of objects of any world so far."""
        return self.pool.max_objects

    @property
    def max_agents(self) -> int:
        """Largest number of agents of any world so far, present or not."""
        return self.pool.max_agents

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

    def replace(self, slots: Sequence[int] | Int64, worlds: Sequence[World | None], policies: Hashable = None) -> None:
        """Put worlds into slots, or for None the same again, for episodes with some policies."""
        slots, pool = np.asarray(slots, np.int64), self.pool
        numbers = np.array([
            pool.number(pool.worlds[self._slots.number[slot]].key[0] if world is None else world, policies)
            for slot, world in zip(slots, worlds, strict=True)
        ])  # fmt: skip
        pool.play(slots, numbers, self._slots)
        self._worlds = None
        if pool.arrays is not self._arrays:
            self._take_arrays()

    def show_pieces(self) -> None:
        """Let ``lines`` have the pieces of the roads, if it has them not yet."""
        if not self.pool.has_pieces:
            self.pool.store_pieces()
            numbers, stored = self._slots.number, self.pool.stored
            self.place[:], self._slots.frame[:] = stored.place[numbers], stored.frame[numbers]
            self._take_arrays()

    def _take_arrays(self) -> None:
        self._arrays = self.pool.arrays
        arrays = self._arrays | {"place": self.place, "frame": self._slots.frame}
        self.recorded = Recorded(**{name: arrays[name] for name in Recorded._fields})
        self.lines = Lines(**{name: arrays[name] for name in Lines._fields})

    def begin_known(self, slots: IntP, coming: IntP, series: Series, begins: Int32) -> int:
        """Let episodes of scenarios begin in slots, if the pool has all of their worlds; see ``play_scenarios``."""
        pool, self._worlds = self.pool, None
        pool.moment += 1
        return play_scenarios(slots, coming, pool.moment, series, pool.stored, self._slots, begins)

    def note(self, slots: IntP, scenarios: IntP, series: Series) -> None:
        """Note that some slots play the worlds of scenarios."""
        numbers = self._slots.number[slots]
        series.playing[slots], series.was_played[scenarios] = scenarios, True
        series.known[scenarios, 0], series.known[scenarios, 1] = numbers, self.pool.stored.usage[numbers, SERIAL]

    def known(self, scenario: int, series: Series) -> World | None:
        """Return the world of a scenario as recorded; None if the pool has it no more."""
        number, serial = series.known[scenario].tolist()
        is_stored = serial and self.pool.stored.usage[number, SERIAL] == serial
        return self.pool.worlds[number].key[0] if is_stored else None
