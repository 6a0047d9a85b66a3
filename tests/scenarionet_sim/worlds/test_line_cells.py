"""Cells of lines, packed: every segment of every cell is found again."""

from __future__ import annotations

import numpy as np
import pytest

from scenarionet_data.scenario.vocabulary import MapFeatureType
from scenarionet_sim.kernels.rays import LINE_BITS
from scenarionet_sim.kernels.structures import CELLS_IN_BLOCK
from scenarionet_sim.roads.grid import Grid
from scenarionet_sim.worlds.line_cells import LineCells

TYPES = np.array([MapFeatureType.ROAD_LINE_SOLID_SINGLE_WHITE, MapFeatureType.ROAD_EDGE_MEDIAN], np.uint8)


@pytest.mark.parametrize(("num_boxes", "side"), [(0, 1.0), (1, 1.0), (900, 400.0), (900, 90.0)])
def test_cells_list_the_items_of_the_grid(num_boxes, side):
    rng = np.random.default_rng(num_boxes)
    lower = rng.uniform(0.0, side, (num_boxes, 2)).astype(np.float32)
    grid = Grid.over(lower, lower + np.float32(2.0), 5.0)
    types = rng.choice(TYPES, len(grid.cell_items))
    cells = LineCells.of(grid, types)
    for cell in range(len(grid.cell_start) - 1):
        inside = slice(*grid.cell_start[cell : cell + 2])
        assert cells.cell_types[cell] == np.bitwise_or.reduce(LINE_BITS[types[inside]], initial=0)
        if cells.cell_types[cell]:
            filled = cells.block_start[cell // CELLS_IN_BLOCK] + cells.cell_rank[cell]
            assert slice(*cells.filled_start[filled : filled + 2]) == inside


def test_every_type_has_a_bit():
    assert (LINE_BITS > 0).all()
    assert LINE_BITS[MapFeatureType.ROAD_LINE_BROKEN_SINGLE_WHITE] != LINE_BITS[MapFeatureType.ROAD_EDGE_BOUNDARY]
