"""A batch of W worlds: every array of every world, stacked and padded for kernels."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import fields
from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Bool, Float32, Float64, Int32, UInt8
from scenarionet_data.arrays.ragged import Ragged
from scenarionet_sim.kernels.structures import Lines, Recorded
from scenarionet_sim.roads.grid import Grid
from scenarionet_sim.roads.roads import Roads
from scenarionet_sim.worlds.paths import Paths, Stops
from scenarionet_sim.worlds.world import World

_SLACK = 1.25
"""Factor by which stacks grow, so that a long run rarely copies."""


class WorldBatch:
    """The worlds of a simulation, one per slot.

    Every array of :class:`World`, its ``paths``, ``stops`` and ``roads`` is an attribute of the same name with a
    leading axis of worlds, C-contiguous, padded at the end to the longest. Ragged lists (``lanes``, ``polygons``)
    become values and offsets (``lanes_offsets``); a grid becomes its parts (``segment_grid_cell_start``, ...);
    scalars become arrays (W,). The ``num_...`` arrays count the unpadded entries; offsets are padded with their
    last value, so padding lists are empty.

    Attributes:
        worlds: The worlds, by slot.
        num_objects, num_steps, num_segments, num_lights, num_lanes, num_polygons: (W,) int32.
        recorded, lines: The arrays as kernels take them.
    """

    num_objects: Int32
    num_steps: Int32
    num_segments: Int32
    num_lights: Int32
    num_lanes: Int32
    num_polygons: Int32

    dt: Float64
    ego: Int32
    object_type: UInt8
    size: Float32
    log: Float32
    top_speed: Float32
    path: Float32
    path_offsets: Int32
    stop_arc: Float32
    stop_light: Int32
    stop_offsets: Int32
    light_lane: Int32
    light_stop: Float32
    light_state: UInt8
    extents: Float32

    segments: Float32
    segment_type: UInt8
    segment_feature: Int32
    segment_grid_frame: Float64
    segment_grid_cell_start: Int32
    segment_grid_cell_items: Int32
    lane_type: UInt8
    lanes: Float32
    lanes_offsets: Int32
    successors: Int32
    successors_offsets: Int32
    speed_limit: Float32
    polygons: Float32
    polygons_offsets: Int32
    polygon_type: UInt8
    polygon_grid_frame: Float64
    polygon_grid_cell_start: Int32
    polygon_grid_cell_items: Int32
    is_road: Bool

    def __init__(self, worlds: Sequence[World]) -> None:
        self.worlds = list(worlds)
        self._arrays = [dict(_arrays(world)) for world in worlds]
        for name in self._arrays[0]:
            self._stack(name, np.max([arrays[name].shape for arrays in self._arrays], axis=0).tolist())
        self._collect()

    def __len__(self) -> int:
        return len(self.worlds)

    @property
    def max_objects(self) -> int:
        """N, including padding."""
        return int(self.object_type.shape[1])

    def replace(self, slot: int, world: World) -> None:
        """Replace the world of a slot; stacks that are too small grow."""
        self.worlds[slot], self._arrays[slot] = world, dict(_arrays(world))
        for name, array in self._arrays[slot].items():
            stack: Array = getattr(self, name)
            if all(need <= room for need, room in zip(array.shape, stack.shape[1:], strict=True)):
                _put(stack, slot, array, name)
            else:
                room = [
                    old if need <= old else int(_SLACK * need)
                    for need, old in zip(array.shape, stack.shape[1:], strict=True)
                ]
                self._stack(name, room)
        self._collect()

    def _stack(self, name: str, room: Sequence[int]) -> None:
        """Rebuild one attribute with a new padded shape."""
        arrays = [arrays[name] for arrays in self._arrays]
        stack = np.zeros((len(arrays), *room), arrays[0].dtype)
        for slot, array in enumerate(arrays):
            _put(stack, slot, array, name)
        setattr(self, name, stack)

    def _collect(self) -> None:
        self.recorded = Recorded(*(getattr(self, name) for name in Recorded._fields))
        grid = self.segment_grid_frame, self.segment_grid_cell_start, self.segment_grid_cell_items
        self.lines = Lines(self.segments, self.segment_type, *grid)


def _put(stack: Array, slot: int, array: Array, name: str) -> None:
    is_offsets = name.endswith(("_offsets", "_cell_start"))
    stack[slot] = array[-1] if is_offsets else 0
    stack[slot, ...][tuple(map(slice, array.shape))] = array


def _arrays(world: World) -> Iterator[tuple[str, Array]]:
    """Yield the arrays of a world under their names in a batch."""
    roads = world.roads
    counts = {
        "num_objects": world.num_objects,
        "num_steps": world.num_steps,
        "num_segments": len(roads.segments),
        "num_lights": len(world.light_lane),
        "num_lanes": roads.num_lanes,
        "num_polygons": len(roads.polygons),
    }
    yield from ((name, np.array(count, np.int32)) for name, count in counts.items())
    yield from _parts("", world)


def _parts(prefix: str, value: Any) -> Iterator[tuple[str, Array]]:
    for column in fields(value):
        part, name = getattr(value, column.name), prefix + column.name
        if isinstance(part, Roads | Paths | Stops):
            yield from _parts("", part)
        elif isinstance(part, Grid):
            yield from _parts(f"{name}_", part)
        elif isinstance(part, Ragged):
            yield name, part.values
            yield f"{name}_offsets", part.offsets
        elif isinstance(part, np.ndarray) and part.dtype != object:
            yield name, part
        elif isinstance(part, int | float):
            yield name, np.array(part, np.int32 if isinstance(part, int) else np.float64)
