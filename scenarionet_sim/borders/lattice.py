"""The border between outcomes in a box of parameters: cells whose corners differ are halved until they are small.

The box is a lattice of cells, few at first. Of the coarse cells all corners are tried, then only those
of halves of cells whose corners differ, and of neighbours that such a cell's face shows the border to enter: what an
octree does, or bisection in one dimension. A library for adaptive sampling (adaptive, scikit-learn's Gaussian
processes) tries one point after the other where it is least sure; here a round is one batch of simulations, the error
is bounded by the cell and not by a model, and the points are the same on every machine. What is smaller than a coarse
cell can be missed.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from itertools import product

import numpy as np
import numpy.typing as npt

LatticePoint = tuple[int, ...]
JudgeOfPoints = Callable[[list[LatticePoint]], list[int]]
"""Returns the outcomes of points."""

MIXED = -1
"""Of a cell that the border crosses."""


class Lattice:
    """Outcomes at the points of a lattice, tried where the border is.

    Args:
        dimensions: Number of axes.
        cells: Cells along each axis in the end.
        judge: Returns the outcomes of points, whole numbers from 0 on.
        monotone: Axes along which the outcome changes at most once: between two equal ones nothing is tried.

    Attributes:
        outcomes: By point.
        tried: The points that were not inferred.
        regions: (cells,) * dimensions, the outcome of each cell, or MIXED.
    """

    def __init__(self, dimensions: int, cells: int, judge: JudgeOfPoints, monotone: Iterable[int] = ()) -> None:
        self.dimensions, self.cells = dimensions, cells
        self.outcomes: dict[LatticePoint, int] = {}
        self.tried: list[LatticePoint] = []
        self.regions: npt.NDArray[np.int8] = np.full((cells,) * dimensions, MIXED, np.int8)
        self._judge, self._monotone = judge, tuple(monotone)
        self._corners = list(product((0, 1), repeat=dimensions))

    def refine(self, coarse: int, most: int) -> int:
        """Halve cells until they have one step, or until more points than allowed would have been tried.

        Args:
            coarse: Cells along each axis at the beginning, those in the end divided by a power of two.
            most: Points that may be tried, before the last round of halving.

        Returns:
            The size of the cells that the border is known to lie in [steps].
        """
        step = self.cells // coarse
        cells = list(product(range(0, self.cells, step), repeat=self.dimensions))
        while True:
            mixed = self._look_at(cells, step)
            if step == 1 or not mixed or len(self.tried) + len(mixed) > most:
                return step
            step //= 2
            cells = [_moved(cell, corner, step) for cell in mixed for corner in self._corners]

    def _look_at(self, cells: list[LatticePoint], step: int) -> list[LatticePoint]:
        """Try the corners of cells, and of neighbours that the border enters; return the cells that it crosses."""
        seen, mixed, waiting = set(cells), [], cells
        while waiting:
            self._try({_moved(cell, corner, step) for cell in waiting for corner in self._corners}, step)
            entered: dict[LatticePoint, None] = {}
            for cell in waiting:
                found = {corner: self.outcomes[_moved(cell, corner, step)] for corner in self._corners}
                is_mixed = len(set(found.values())) > 1
                outcome = MIXED if is_mixed else found[self._corners[0]]
                self.regions[tuple(slice(at, at + step) for at in cell)] = outcome
                mixed += [cell] * is_mixed
                for axis, side in product(range(self.dimensions), (0, 1)) if is_mixed else ():
                    next_to = (*cell[:axis], cell[axis] + (2 * side - 1) * step, *cell[axis + 1 :])
                    is_inside = 0 <= next_to[axis] < self.cells
                    if len({found[each] for each in found if each[axis] == side}) > 1 and is_inside:
                        entered[next_to] = None
            waiting = [cell for cell in entered if cell not in seen]
            seen.update(waiting)
        return mixed

    def _try(self, points: set[LatticePoint], step: int) -> None:
        """JudgeOfPoints the points that are not known, of a monotone axis first those of coarser cells."""
        new = sorted(points - set(self.outcomes))
        parts = [
            [point for point in new if any(point[axis] % (2 * step) for axis in self._monotone) == is_fine]
            for is_fine in (False, True)
        ]
        for part in parts:
            self.outcomes |= {point: found for point in part if (found := self._between(point)) is not None}
            left = [point for point in part if point not in self.outcomes]
            self.outcomes |= dict(zip(left, self._judge(left), strict=True)) if left else {}
            self.tried += left

    def _between(self, point: LatticePoint) -> int | None:
        """Return the outcome that a point has between two equal ones along a monotone axis."""
        for axis in self._monotone:
            near = deque[int]()
            for way in (range(point[axis] - 1, -1, -1), range(point[axis] + 1, self.cells + 1)):
                line = ((*point[:axis], at, *point[axis + 1 :]) for at in way)
                near.extend([self.outcomes[each] for each in line if each in self.outcomes][:1])
            if len(near) == 2 and near[0] == near[1]:
                return near[0]
        return None


def _moved(cell: LatticePoint, corner: LatticePoint, step: int) -> LatticePoint:
    return tuple(at + step * side for at, side in zip(cell, corner, strict=True))
