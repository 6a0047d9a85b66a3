"""Worlds in flat arrays: shared by slots, complete, and unchanged by the worlds that come and go around them."""

from __future__ import annotations

import pickle
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from scenarionet_sim.arrays.structures import (
    BLOCKS,
    CELLS,
    LIGHTS,
    LOG,
    NUM_OBJECTS,
    NUM_STEPS,
    OBJECTS,
    PIECE_CELLS,
)
from scenarionet_sim.worlds.blocks import Blocks
from scenarionet_sim.worlds.world import World
from scenarionet_sim.worlds.world_batch import WorldBatch
from tests.fixtures.scenarios import make_scenario


@cache
def small() -> World:
    return World.from_scenario(make_scenario(1, num_objects=3, num_lanes=2, num_lights=0))


@cache
def middle() -> World:
    return World.from_scenario(make_scenario(2))


@cache
def large() -> World:
    return World.from_scenario(make_scenario(3, num_objects=40, num_steps=60, num_lanes=20, num_lights=9))


@cache
def bare() -> World:
    return World.from_scenario(make_scenario(4, num_objects=1, num_lights=0, has_map=False))


def check(batch: WorldBatch, slot: int, world: World) -> None:
    """Compare every array of a world with its rows in the pool."""
    assert batch.worlds[slot] is world
    recorded, lines, place = batch.recorded, batch.lines, batch.place[slot]
    count, steps, first = world.num_objects, world.num_steps, place[OBJECTS]
    assert (place[NUM_OBJECTS], place[NUM_STEPS]) == (count, steps)
    rows = slice(place[LOG], place[LOG] + count * steps)
    np.testing.assert_array_equal(recorded.log[rows].reshape(steps, count, 8), world.log)
    for name in ("object_type", "size", "top_speed"):
        np.testing.assert_array_equal(getattr(recorded, name)[first : first + count], getattr(world, name))
    for offsets, wanted, values in (
        (recorded.path_offsets, world.paths.path_offsets, (("path", world.paths.path),)),
        (
            recorded.stop_offsets,
            world.stops.stop_offsets,
            (("stop_arc", world.stops.stop_arc), ("stop_light", world.stops.stop_light)),
        ),
    ):
        found = offsets[first : first + count + 1]
        np.testing.assert_array_equal(found - found[0], wanted)
        for name, rows_of_world in values:
            np.testing.assert_array_equal(getattr(recorded, name)[found[0] : found[-1]], rows_of_world)
    lights = world.light_state.size
    np.testing.assert_array_equal(
        recorded.light_state[place[LIGHTS] : place[LIGHTS] + lights], world.light_state.ravel()
    )
    grid = world.roads.segment_grid
    np.testing.assert_array_equal(lines.frame[slot, :5], grid.frame)
    cells = slice(place[CELLS], place[CELLS] + len(grid.cell_types))
    np.testing.assert_array_equal(lines.cell_types[cells], grid.cell_types)
    np.testing.assert_array_equal(lines.cell_rank[cells], grid.cell_rank)
    blocks = lines.block_start[place[BLOCKS] : place[BLOCKS] + len(grid.block_start)]
    np.testing.assert_array_equal(blocks - blocks[0], grid.block_start)
    starts = lines.filled_start[blocks[0] : blocks[0] + len(grid.filled_start)]
    np.testing.assert_array_equal(starts - starts[0], grid.filled_start)
    found = slice(starts[0], starts[-1])
    np.testing.assert_array_equal(lines.segments[found], world.roads.segments[grid.cell_items])
    np.testing.assert_array_equal(lines.segment_type[found], world.roads.segment_type[grid.cell_items])
    if batch.pool.has_pieces:
        pieces = world.roads.pieces
        np.testing.assert_array_equal(lines.frame[slot, 5:], pieces.frame)
        starts = lines.piece_start[place[PIECE_CELLS] :][: len(pieces.start)]
        np.testing.assert_array_equal(starts - starts[0], pieces.start)
        np.testing.assert_array_equal(lines.pieces[starts[0] : starts[-1]], pieces.numbers)


def test_every_array_of_every_world_is_in_the_pool():
    batch = WorldBatch([small(), large(), bare()])
    for slot, world in enumerate((small(), large(), bare())):
        check(batch, slot, world)
    assert batch.num_objects.tolist() == [3, 40, 1]
    assert batch.num_steps.tolist() == [31, 60, 31]
    assert batch.max_objects == 40


def test_slots_share_a_world():
    batch = WorldBatch([small(), middle(), small(), small()])
    assert len(batch.pool) == 2
    np.testing.assert_array_equal(batch.place[0], batch.place[2])
    log = batch.recorded.log
    for _ in range(10):
        batch.replace([1], [small()])
        batch.replace([1], [middle()])
    assert batch.recorded.log is log


def test_worlds_on_one_map_share_its_lines():
    first, second = (replace(middle(), scenario_id=name) for name in ("first", "second"))
    batch = WorldBatch([first, second], keep=0)
    check(batch, 0, first)
    check(batch, 1, second)
    assert batch.place[0, CELLS] == batch.place[1, CELLS] and batch.place[0, LOG] != batch.place[1, LOG]
    batch.replace([0], [small()])
    check(batch, 1, second)  # the map stays for the other one
    batch.replace([1], [small()])
    batch.replace([0], [first])
    check(batch, 0, first)


def test_worlds_come_and_go_without_a_trace():
    """Blocks of other sizes are stored in the gaps that removed worlds leave."""
    rng, worlds = np.random.default_rng(0), [small(), middle(), large(), bare()]
    batch, playing = WorldBatch([small(), middle()], keep=1), [small(), middle()]
    sizes = []
    for turn in range(60):
        if turn == 10:
            batch.show_pieces()
        slot, world = int(rng.integers(2)), worlds[rng.integers(4)]
        batch.replace([slot], [world])
        playing[slot] = world
        for number, expected in enumerate(playing):
            check(batch, number, expected)
        assert len(batch.pool) <= 3
        sizes.append(len(batch.recorded.log))
    assert sizes[-1] == sizes[20], "the pool grows without end"


def test_logs_of_stored_worlds_are_read_from_the_pool():
    """In one piece of memory, also after the pool has grown or dropped the world, and for several pools."""
    world = World.from_scenario(make_scenario(2))
    wanted = world.log.copy()
    batch, other = WorldBatch([world, small()], keep=0), WorldBatch([world])
    assert "log" not in vars(world)
    np.testing.assert_array_equal(world.log, wanted)
    for turn in range(3):
        batch.replace([0], [large()])
        np.testing.assert_array_equal(world.log, wanted)
        batch.replace([0], [world])
        batch.replace([1], [(bare(), middle(), large())[turn]])
        assert "log" not in vars(world)
        np.testing.assert_array_equal(pickle.loads(pickle.dumps(world)).log, wanted)
        batch.replace([0], [small()])
    other.replace([0], [small()])
    np.testing.assert_array_equal(world.log, wanted)
    with pytest.raises(AttributeError, match="no attribute 'logs'"):
        _ = world.logs


def test_blocks_fill_gaps():
    blocks = Blocks({"value": np.int64, "pair": (np.float32, 2)})
    kept = {}
    for number in range(1, 9):
        kept[number] = blocks.put({"value": np.full(number, number), "pair": np.full((number, 2), number)})
    capacity = len(blocks.arrays["value"])
    for number in (2, 4, 3, 7):
        blocks.remove(*kept.pop(number))
    joined = blocks.put({"value": np.full(9, 9), "pair": np.full((9, 2), 9)})  # rows of 2, 3 and 4
    assert joined == (1, 10)
    kept[9] = joined
    assert len(blocks.arrays["value"]) == capacity
    for number, (start, end) in kept.items():
        assert end - start == number
        assert (blocks.arrays["value"][start:end] == number).all()
        assert (blocks.arrays["pair"][start:end] == number).all()
    assert (
        blocks.put({"value": np.zeros(0), "pair": np.zeros((0, 2))})[0]
        == blocks.put({"value": np.ones(1), "pair": np.ones((1, 2))})[0]
    )
