"""Recorded worlds in flat arrays, each stored once and shared by any number of slots."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Bool, Float32, Float64, IntP, UInt8
from scenarionet_data.compiled.checking import unchecked
from scenarionet_sim.arrays.log import VALID
from scenarionet_sim.arrays.structures import (
    BLOCKS,
    CELLS,
    DRIVERS,
    EGO,
    FIRST_STEP,
    FREE,
    LIGHTS,
    LOG,
    NUM_OBJECTS,
    NUM_STEPS,
    OBJECTS,
    PIECE_CELLS,
    SERIAL,
    USED,
    USERS,
    Slots,
    StoredWorlds,
)
from scenarionet_sim.roads.roads import Roads
from scenarionet_sim.worlds.blocks import Blocks
from scenarionet_sim.worlds.episode_kernels import play_worlds
from scenarionet_sim.worlds.world import World

_FEWEST = 32
"""Numbers of worlds that there is room for at first."""

Prepare = Callable[[World, Hashable], tuple[World, UInt8, Bool]]
"""Takes a world and the policies of an episode; returns the world as these need it, each object's policy (N,), and
which objects are agents (N,)."""


@dataclass(eq=False)
class PooledWorld:
    """A world in a pool.

    Attributes:
        key: The world as recorded, and the policies it was prepared for.
        world: As these need it.
        blocks: First row and end of its block of each kind.
        map: The map, which other worlds may have as well.
    """

    key: tuple[World, Hashable]
    world: World
    blocks: dict[str, tuple[int, int]]
    map: PooledMap

    @property
    def name(self) -> tuple[int, int]:
        """Identity of its key."""
        world, policies = self.key
        return id(world), id(policies)


@dataclass(eq=False)
class PooledMap:
    """A map in a pool.

    Attributes:
        roads: The map.
        frame: (10,) those of its grids over the lines and over the pieces.
        blocks: First row and end of its block of each kind.
        num_worlds: Number of stored worlds that have it.
    """

    roads: Roads
    frame: Float64
    blocks: dict[str, tuple[int, int]]
    num_worlds: int = 0


class WorldPool:
    """Worlds in flat arrays.

    A world stays while a slot plays it; of the others, the last ``keep`` stay. So memory depends on the number of
    different worlds, not on that of slots or episodes.

    Args:
        prepare: Prepares each world once for the same policies.
        keep: Number of worlds to keep that no slot plays.

    Attributes:
        kinds: The arrays of all worlds, by kind of block.
        arrays: The same by name, as ``arrays.structures.Recorded`` and ``Lines`` describe them.
        worlds: The worlds by number; numbers of removed ones are used again.
        stored: Where their rows are, and which are played.
        moment: Number of times that worlds were put into slots.
        max_objects, max_agents, max_pieces: Largest number of objects, agents and pieces of any world so far.
        has_pieces: Whether worlds are stored with the pieces of their roads, see :meth:`store_pieces`.
    """

    def __init__(self, prepare: Prepare, keep: int) -> None:
        self._prepare, self._keep = prepare, keep
        self._numbers: dict[tuple[int, int], int] = {}  # by identity of world and policies
        self.worlds: dict[int, PooledWorld] = {}
        self._maps: dict[int, PooledMap] = {}  # by identity of the roads
        self.stored = StoredWorlds.of_none()
        self._free: list[int] = []
        self._num_stored = 0
        self.moment = 0
        self.kinds = {
            "objects": Blocks({
                "driver": np.uint8, "object_type": np.uint8, "size": (np.float32, 3), "top_speed": np.float32,
                "friction": np.float64, "path_offsets": np.int32, "stop_offsets": np.int32,
            }),
            "log": Blocks({"log": (np.float32, 8)}),
            "path": Blocks({"path": (np.float32, 5)}),
            "stops": Blocks({"stop_arc": np.float32, "stop_light": np.int32}),
            "lights": Blocks({"light_state": np.uint8}),
            "cells": Blocks({"cell_types": np.uint8, "cell_rank": np.uint8}),
            "blocks": Blocks({"block_start": np.int32}),
            "filled": Blocks({"filled_start": np.int32}),
            "segments": Blocks({"segments": (np.float32, 4), "segment_type": np.uint8}),
            "piece_cells": Blocks({"piece_start": np.int32}),
            "pieces": Blocks({"pieces": (np.float32, 8)}),
        }  # fmt: skip
        self.arrays = self._by_name()
        self.max_objects = self.max_agents = self.max_pieces = 0
        self.has_pieces = False

    def __len__(self) -> int:
        return len(self._numbers)

    def number(self, world: World, policies: Hashable) -> int:
        """Return the number of a world for some policies; store it if it is new."""
        found = self._numbers.get((id(world), id(policies)))
        return self._store(world, policies) if found is None else found

    def play(self, which: IntP, numbers: IntP, slots: Slots) -> None:
        """Put worlds into slots, and remove those that no slot has played for longest; see ``play_worlds``."""
        self.moment += 1
        num_unused = unchecked(play_worlds)(which, numbers, self.moment, self.stored, slots)
        if num_unused > self._keep:
            usage = self.stored.usage
            unused = np.flatnonzero(usage[:, USERS] == 0)
            longest = np.argsort(usage[unused, USED], kind="stable")
            for number in unused[longest[: num_unused - self._keep]].tolist():
                removed = self.worlds.pop(number)
                for world in (removed.key[0], removed.world):
                    world.restore_log()
                del self._numbers[removed.name]
                self._remove(removed.blocks)
                removed.map.num_worlds -= 1
                if not removed.map.num_worlds:
                    self._remove(self._maps.pop(id(removed.map.roads)).blocks)
                usage[number, USERS], usage[number, SERIAL] = FREE, 0
                self._free.append(number)

    def store_pieces(self) -> None:
        """Store the pieces of the roads of all maps, and of those to come, which takes milliseconds each."""
        self.has_pieces = True
        for pooled_map in self._maps.values():
            self._put_pieces(pooled_map)
        for number in self.worlds:
            self._show_map(number)
        self.arrays = self._by_name()

    def _put_pieces(self, pooled_map: PooledMap) -> None:
        pieces = pooled_map.roads.pieces
        at = self.kinds["pieces"].put({"pieces": pieces.numbers})
        pooled_map.blocks |= {
            "pieces": at,
            "piece_cells": self.kinds["piece_cells"].put({"piece_start": at[0] + pieces.start}),
        }
        pooled_map.frame[5:] = pieces.frame
        self.max_pieces = max(self.max_pieces, len(pieces.numbers))

    def _show_map(self, number: int) -> None:
        """Note where the map of a world is stored."""
        pooled_map, place = self.worlds[number].map, self.stored.place[number]
        self.stored.frame[number] = pooled_map.frame
        place[CELLS], place[BLOCKS] = pooled_map.blocks["cells"][0], pooled_map.blocks["blocks"][0]
        place[PIECE_CELLS] = pooled_map.blocks.get("piece_cells", (0, 0))[0]

    def _by_name(self) -> dict[str, Array]:
        return {name: array for kind in self.kinds.values() for name, array in kind.arrays.items()}

    def _store(self, original: World, policies: Hashable) -> int:
        world, driver, are_agents = self._prepare(original, policies)
        count, pooled_map = world.num_objects, self._map(world.roads)
        path = self.kinds["path"].put({"path": world.paths.path})
        stops = self.kinds["stops"].put({"stop_arc": world.stops.stop_arc, "stop_light": world.stops.stop_light})
        blocks = {
            "path": path,
            "stops": stops,
            "objects": self.kinds["objects"].put({
                "driver": driver, "object_type": world.object_type, "size": world.size,
                "top_speed": world.top_speed, "friction": np.full(count, world.friction),
                "path_offsets": path[0] + world.paths.path_offsets,
                "stop_offsets": stops[0] + world.stops.stop_offsets,
            }),
            "log": self.kinds["log"].put({"log": world.log.reshape(-1, 8)}),
            "lights": self.kinds["lights"].put({"light_state": world.light_state.ravel()}),
        }  # fmt: skip
        self.arrays = self._by_name()
        self.max_objects, self.max_agents = max(self.max_objects, count), max(self.max_agents, int(are_agents.sum()))
        number, room = self._free.pop() if self._free else len(self.worlds), len(self.stored.usage)
        if number == room:
            more = max(room, _FEWEST)
            self.stored = StoredWorlds(
                *(np.concatenate([old, np.full((more, *old.shape[1:]), FREE, old.dtype)]) for old in self.stored)
            )
        self.worlds[number] = pooled = PooledWorld((original, policies), world, blocks, pooled_map)
        self._numbers[pooled.name] = number
        place = self.stored.place[number]
        self._num_stored += 1
        self.stored.usage[number] = 0, self.moment, self._num_stored
        place[NUM_OBJECTS], place[NUM_STEPS], place[EGO] = count, world.num_steps, world.ego
        place[FIRST_STEP] = int(np.argmax(world.log[:, world.ego, VALID] != 0))
        place[DRIVERS] = np.bitwise_or.reduce(np.left_shift(1, driver[driver < 63], dtype=np.int64), initial=0)
        place[OBJECTS], place[LOG] = blocks["objects"][0], blocks["log"][0]
        place[LIGHTS] = blocks["lights"][0]
        pooled_map.num_worlds += 1
        self._show_map(number)
        read_log = partial(_log_in, self.kinds["log"], blocks["log"], world.log.shape)
        for same in [each for each in (original, world) if each.log is world.log]:  # policies may change the log
            same.store_log(read_log)  # the pool has it now
        return number

    def _map(self, roads: Roads) -> PooledMap:
        """Return the map of a world; store it if no other world has it."""
        if id(roads) in self._maps:
            return self._maps[id(roads)]
        grid = roads.segment_grid
        items = grid.cell_items
        segments = self.kinds["segments"].put(
            {"segments": roads.segments[items], "segment_type": roads.segment_type[items]}
        )
        filled = self.kinds["filled"].put({"filled_start": segments[0] + grid.filled_start})
        blocks = {
            "segments": segments,
            "filled": filled,
            "blocks": self.kinds["blocks"].put({"block_start": filled[0] + grid.block_start}),
            "cells": self.kinds["cells"].put({"cell_types": grid.cell_types, "cell_rank": grid.cell_rank}),
        }
        self._maps[id(roads)] = pooled = PooledMap(roads, np.append(grid.frame, np.zeros(5)), blocks)
        if self.has_pieces:
            self._put_pieces(pooled)
        roads.forget_segment_grid()  # the pool has it now
        return pooled

    def _remove(self, blocks: Mapping[str, tuple[int, int]]) -> None:
        for kind, block in blocks.items():
            self.kinds[kind].remove(*block)


def _log_in(blocks: Blocks, block: tuple[int, int], shape: tuple[int, ...]) -> Float32:
    """Return a copy of the log of a stored world."""
    return blocks.arrays["log"][slice(*block)].reshape(shape).copy()
