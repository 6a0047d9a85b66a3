"""The packed grid over lines: every segment of every cell is found again."""

from __future__ import annotations

import numpy as np
import pytest

from scenarionet_data.scenario.vocabulary import MapFeatureType
from scenarionet_sim.arrays.structures import CELLS_IN_BLOCK
from scenarionet_sim.roads.grid import Grid
from scenarionet_sim.roads.line_grid import LineGrid
from scenarionet_sim.roads.ray_kernels import LINE_BITS

TYPES = np.array([MapFeatureType.ROAD_LINE_SOLID_SINGLE_WHITE, MapFeatureType.ROAD_EDGE_MEDIAN], np.uint8)


@pytest.mark.parametrize(("count", "side"), [(0, 1.0), (1, 1.0), (900, 400.0), (900, 90.0)])
def test_cells_list_the_segments_of_the_whole_grid(count, side):
    rng = np.random.default_rng(count)
    start = rng.uniform(0.0, side, (count, 2))
    segments = np.concatenate([start, start + rng.uniform(-4.0, 4.0, (count, 2))], axis=1).astype(np.float32)
    types = rng.choice(TYPES, count)
    whole = Grid.over(np.minimum(*np.split(segments, 2, axis=1)), np.maximum(*np.split(segments, 2, axis=1)), 5.0)
    packed = LineGrid.over(segments, types)
    np.testing.assert_array_equal(packed.frame, whole.frame)
    np.testing.assert_array_equal(packed.cell_items, whole.cell_items)
    for cell in range(len(whole.cell_start) - 1):
        inside = slice(*whole.cell_start[cell : cell + 2])
        bits = np.bitwise_or.reduce(LINE_BITS[types[whole.cell_items[inside]]], initial=0)
        assert packed.cell_types[cell] == bits
        if bits:
            filled = packed.block_start[cell // CELLS_IN_BLOCK] + packed.cell_rank[cell]
            assert slice(*packed.filled_start[filled : filled + 2]) == inside


def test_every_type_has_a_bit():
    assert (LINE_BITS > 0).all()
    assert LINE_BITS[MapFeatureType.ROAD_LINE_BROKEN_SINGLE_WHITE] != LINE_BITS[MapFeatureType.ROAD_EDGE_BOUNDARY]
