"""Batches of worlds: every array of every world, independent of earlier worlds in the slot."""

from __future__ import annotations

from dataclasses import fields
from functools import cache

import numpy as np

from scenarionet_data.arrays.ragged import Ragged
from scenarionet_sim.roads.grid import Grid
from scenarionet_sim.roads.roads import Roads
from scenarionet_sim.worlds.paths import Paths, Stops
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


def check(batch: WorldBatch, slot: int, value: object, prefix: str = "") -> int:
    """Compare a world with its slot; return the number of arrays."""
    count = 0
    for column in fields(value):
        part, name = getattr(value, column.name), prefix + column.name
        if isinstance(part, Roads | Paths | Stops):
            count += check(batch, slot, part)
        elif isinstance(part, Grid):
            count += check(batch, slot, part, f"{name}_")
        elif isinstance(part, Ragged):
            offsets = getattr(batch, f"{name}_offsets")[slot]
            np.testing.assert_array_equal(offsets[: len(part.offsets)], part.offsets)
            assert (offsets[len(part.offsets) :] == part.offsets[-1]).all()
            np.testing.assert_array_equal(getattr(batch, name)[slot, : len(part.values)], part.values)
            count += 1
        elif not isinstance(part, str) and np.asarray(part).dtype != object:
            array, stack = np.asarray(part), getattr(batch, name)
            assert stack.flags.c_contiguous
            np.testing.assert_array_equal(stack[(slot, *map(slice, array.shape))], array)
            count += 1
    return count


def test_every_array_of_every_world_is_stacked():
    batch = WorldBatch([small(), large(), bare()])
    for slot, world in enumerate(batch.worlds):
        assert check(batch, slot, world) > 30
    assert batch.num_objects.tolist() == [3, 40, 1]
    assert batch.num_steps.tolist() == [31, 60, 31]
    assert batch.num_lights.tolist() == [0, 9, 0]
    assert batch.num_lanes.tolist() == [2, 20, 0]
    assert batch.max_objects == 40


def test_larger_and_smaller_worlds_replace_each_other():
    batch = WorldBatch([small(), middle()])
    for world in (large(), small(), bare(), middle()):
        batch.replace(0, world)
        check(batch, 0, world)
        check(batch, 1, middle())
    assert batch.worlds == [middle(), middle()]
    assert not batch.log[0, middle().num_steps :].any() and not batch.log[0, :, middle().num_objects :].any()


def test_capacity_is_kept_to_avoid_copies_in_long_runs():
    batch = WorldBatch([small()])
    batch.replace(0, large())
    log = batch.log
    for world in (small(), bare(), large(), middle()):
        batch.replace(0, world)
    assert batch.log is log


def test_annotations_match_the_arrays():
    batch = WorldBatch([middle()])
    assert {name for name in vars(batch) if isinstance(getattr(batch, name), np.ndarray)} == set(
        WorldBatch.__annotations__
    )
