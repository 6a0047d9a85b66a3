"""Search for the border at which a policy begins to fail in a logical scenario.

Every round writes the concrete scenarios of some points of a lattice into the lake and evaluates the policy on them, so
all of them are scenarios with results, and an interrupted search goes on where it was.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from itertools import product
from operator import add
from pathlib import Path
from typing import Any

import numpy as np

from scenarionet_data import Lake, convert
from scenarionet_data.arrays.dtypes import Float64, is_count
from scenarionet_data.errors import BadParameter, QueryError, needing
from scenarionet_data.logical import LogicalScenario, read_logical
from scenarionet_data.scenario.description import make_scenario_id
from scenarionet_data.scenario.settings import check_is, check_settings
from scenarionet_data.variations.parameters import QUANTILES, DistributedParameter, correlated, distribution_text
from scenarionet_sim.borders.lattice import MIXED, Lattice, LatticePoint
from scenarionet_sim.evaluation.evaluation import evaluate

PASSES, FAILS, IMPOSSIBLE = range(3)
"""Outcomes: the policy passes, fails, or the scenario cannot be."""

COARSE = (4, 5, 6, 7)
"""Cells along each axis at the beginning: what leads to the fewest in the end; with many parameters the first."""

CONTROLS = 32
"""Points away from the border that are simulated to compare them with what is predicted."""

FAILURE = "coalesce(first_collision <= duration, false)"
"""The policy touches another road user while something is recorded."""

_TAIL = 1e-3  # quantile at which a distribution that has no ends is cut off


@dataclass(frozen=True)
class SearchSpace:
    """What is searched.

    Attributes:
        logical: A logical scenario: a file, or a name of the library.
        policy: See :func:`scenarionet_sim.evaluate`.
        parameters: Other distributions of some parameters, by name; one value leaves it out of the search.
        failure: SQL over ``results`` and ``metadata`` that holds where the policy fails.
        resolution: Largest distance of the border from the middle of a cell that it crosses, as a share of each range.
        monotone: Parameters along which the outcome changes at most once.
        most: Scenarios that may be simulated before the last round.
        traffic, tracker, seed: See :func:`scenarionet_sim.evaluate`.
    """

    logical: str
    policy: str
    parameters: Mapping[str, Any] = field(default_factory=dict)
    failure: str = FAILURE
    resolution: float = 0.02
    monotone: tuple[str, ...] = ()
    most: int = 5000
    traffic: str = "replay"
    tracker: str = "lqr"
    seed: int = 0

    def __post_init__(self) -> None:
        check_settings(self)
        check_is("parameters", self.parameters, Mapping, "distributions by name")
        check_is("monotone", self.monotone, tuple | list, "names of parameters, such as ('gap',)")
        if not 0.001 <= self.resolution <= 0.25 or not is_count(self.most, 1):
            raise BadParameter(
                f"resolution={self.resolution}, most={self.most}: wanted a share from 0.001 to 0.25, and 1 or more"
            )
        unknown = sorted({*self.parameters, *self.monotone} - {each.name for each in self.scenario.parameters})
        if unknown:
            have = ", ".join(each.name for each in self.scenario.parameters)
            raise BadParameter(f"{self.logical} has no parameter {unknown[0]!r}; it has {have}")
        if not self.axes:
            raise BadParameter(f"{self.logical}: every parameter has one value; a search wants a range of at least one")

    @property
    def scenario(self) -> LogicalScenario:
        """The logical scenario, with the parameters given here."""
        logical = read_logical(self.logical)
        parameters = [
            DistributedParameter(each.name, distribution_text(self.parameters.get(each.name, each.distribution)))
            for each in logical.parameters
        ]
        return replace(logical, parameters=tuple(parameters))

    @property
    def axes(self) -> tuple[DistributedParameter, ...]:
        """The parameters that have more than one value."""
        return tuple(each for each in self.scenario.parameters if np.ptp(each.at(np.array([0.0, 1.0]))) > 0)

    def shares(self, cells: int) -> Float64:
        """Return the share of the distribution in each of ``cells`` along each axis, which correlations make unequal.

        Parameters that have one value do not count. Without correlations all shares are equal; otherwise each is that
        of 2^18 points of Sobol's sequence.
        """
        dimensions = len(self.axes)
        correlation = self.scenario.correlations([each.name for each in self.axes])
        if (correlation == np.eye(dimensions)).all():
            return np.full((cells,) * dimensions, 1.0 / cells**dimensions)
        with needing("correlations need scipy", "vary"):
            from scipy.stats import qmc
        points = correlated(qmc.Sobol(dimensions, rng=np.random.default_rng(0)).random_base2(18), correlation)
        return np.asarray(np.histogramdd(points, cells, [(0.0, 1.0)] * dimensions)[0] / len(points))

    @property
    def halvings(self) -> tuple[int, int]:
        """Cells along each axis at the beginning and in the end."""
        few = COARSE if len(self.axes) <= 3 else COARSE[:1]
        wanted = [(max(math.ceil(math.log2(0.5 / self.resolution / each)), 0), each) for each in few]
        cells, coarse = min((each * 2**times, each) for times, each in wanted)
        return coarse, cells


@dataclass(frozen=True)
class SearchReport:
    """What a search has found.

    Attributes:
        axes: Names of the parameters.
        edges: Values of each at the edges of the cells.
        regions: An axis each: PASSES, FAILS or IMPOSSIBLE in a cell, MIXED where the border crosses it.
        simulated, impossible: Scenarios that were simulated, and that cannot be.
        resolution: Largest distance of the border from the middle of a cell that it crosses, as a share of each range.
        border: Name of the database of the scenarios on either side of the border; empty if there are none.
        controls, wrong: Scenarios away from the border that were compared with what is predicted; that differ.
        shares: Shares of the distribution in the cells, as the regions.
    """

    axes: tuple[str, ...]
    edges: tuple[tuple[float, ...], ...]
    regions: Any = field(repr=False, compare=False)
    simulated: int
    impossible: int
    resolution: float
    border: str
    controls: int
    wrong: int
    shares: Any = field(repr=False, compare=False)

    @property
    def failing(self) -> tuple[float, float]:
        """Least and largest share of what can be that fails, by the distributions of the parameters."""
        fails, mixed, impossible = (
            float(self.shares[self.regions == each].sum()) for each in (FAILS, MIXED, IMPOSSIBLE)
        )
        possible = 1.0 - impossible
        return (fails / possible, (fails + mixed) / possible) if possible > 0 else (math.nan, math.nan)


def search(
    lake: Lake | Path | str,
    space: SearchSpace,
    *,
    name: str,
    workers: int = 1,
    on_round: Callable[[int, int], None] | None = None,
) -> SearchReport:
    """Find the border of failure, and store its scenarios as the database ``NAME_border``.

    The scenarios are version ``name`` of the dataset ``logical``, their results the runs ``NAME-00``, ``NAME-01``, ...
    The same call goes on where it was interrupted.

    Args:
        lake: The lake; made if it is none.
        space: What is searched.
        name: Of the search: letters, digits, ``_`` and ``-``.
        workers: Number of processes.
        on_round: Called after each round with its number and the scenarios that were simulated so far.

    Raises:
        BadParameter: A name or a policy is wrong, or a scenario could not be simulated.
        DuplicateScenario: There is a search of that name over other values.
        QueryError: ``failure`` is no condition.
    """
    check_is("lake", lake, Lake | str | Path, "a lake, its path or its URL")
    check_is("space", space, SearchSpace, "SearchSpace('cut_in', 'idm')")
    check_is("name", name, str, "a text")
    if not name.replace("_", "").replace("-", "").isalnum():
        raise BadParameter(f"name {name!r}: use letters, digits, '_' and '-'")
    root = str(lake.root if isinstance(lake, Lake) else lake)
    rounds = _Rounds(root, space, name, workers, on_round)
    names = [each.name for each in space.axes]
    coarse, cells = space.halvings
    lattice = Lattice(len(names), cells, rounds.judge, (names.index(each) for each in space.monotone))
    step = lattice.refine(coarse, space.most)
    wrong, controls = rounds.control(lattice)
    cells_of_border = {tuple((cell // step * step).tolist()) for cell in np.argwhere(lattice.regions == MIXED)}
    sides = {
        tuple(map(add, cell, corner)) for cell in cells_of_border for corner in product((0, step), repeat=len(cell))
    }
    ids = sorted(
        rounds.ids[point] for point in lattice.tried if point in sides and lattice.outcomes[point] < IMPOSSIBLE
    )
    border = f"{name}_border" if ids else ""
    if ids:
        Lake(root).filter(ids=ids, name=border, replace=True)
    impossible = sum(lattice.outcomes[point] == IMPOSSIBLE for point in lattice.tried)
    at = rounds.quantiles(np.arange(cells + 1)[:, None] * np.ones(len(names)))
    edges = tuple(tuple(each.at(column).tolist()) for each, column in zip(space.axes, at.T, strict=True))
    simulated = len(lattice.tried) + controls - impossible
    size = 0.5 * step / cells
    return SearchReport(
        tuple(names), edges, lattice.regions, simulated, impossible, size, border, controls, wrong, space.shares(cells)
    )


class _Rounds:
    """Simulates points of a lattice, round by round."""

    def __init__(
        self, root: str, space: SearchSpace, name: str, workers: int, on_round: Callable[[int, int], None] | None
    ) -> None:
        self._root, self._space, self._name, self._workers, self._on_round = root, space, name, workers, on_round
        self._logical, self._number, self._simulated = space.scenario, 0, 0
        self.ids: dict[LatticePoint, str] = {}

    def quantiles(self, points: Float64) -> Float64:
        """Quantiles (n, d) of points in steps; of distributions without ends within them."""
        texts = [each.distribution for each in self._space.axes]
        ends = np.array([_TAIL * ("(" in text and not text.startswith(QUANTILES)) for text in texts])
        return np.asarray((points / self._space.halvings[1]).clip(ends, 1.0 - ends))

    def judge(self, points: list[LatticePoint]) -> list[int]:
        """Write and evaluate the scenarios of points; return their outcomes."""
        names = [f"{self._logical.name}-{'_'.join(f'{at:04d}' for at in point)}" for point in points]
        ids, fails = self._simulate(dict(zip(names, self.quantiles(np.array(points, np.float64)), strict=True)))
        self.ids |= dict(zip(points, ids, strict=True))
        return [fails.get(each, IMPOSSIBLE) for each in ids]

    def control(self, lattice: Lattice) -> tuple[int, int]:
        """Simulate points away from the border; return how many differ from what is predicted, and their number."""
        rng = np.random.default_rng(self._space.seed)
        at = rng.random((CONTROLS, lattice.dimensions)) * lattice.cells
        predicted = lattice.regions[tuple(at.astype(np.intp).T)]
        at, predicted = at[predicted != MIXED], predicted[predicted != MIXED]
        names = [f"{self._logical.name}-control{k:03d}" for k in range(len(at))]
        ids, fails = self._simulate(dict(zip(names, self.quantiles(at), strict=True)))
        return sum(fails.get(each, IMPOSSIBLE) != it for each, it in zip(ids, predicted.tolist(), strict=True)), len(
            ids
        )

    def _simulate(self, quantiles: Mapping[str, Float64]) -> tuple[list[str], dict[str, int]]:
        """Evaluate concrete scenarios by name; return their ids, and the outcomes of those that can be."""
        columns = iter(np.array(list(quantiles.values())).T)
        searched = {each.name for each in self._space.axes}
        values = np.stack(
            [each.at(next(columns) if each.name in searched else np.full(len(quantiles), 0.5))
             for each in self._logical.parameters], axis=1,
        )  # fmt: skip
        run, name, space = f"{self._name}-{self._number:02d}", self._name, self._space
        rows = dict(zip(quantiles, values.tolist(), strict=True))
        options = {"rows": json.dumps(rows)}
        report = convert(
            "logical", space.logical, self._root, split="test", version=name, options=options, workers=self._workers
        )
        if report.failed:
            raise BadParameter(f"{space.logical}: {report.failed[0][1]}")
        ids = [make_scenario_id("logical", name, each) for each in rows]
        have = {row[0] for row in Lake(self._root).sql(
            "SELECT scenario_id FROM metadata WHERE dataset = 'logical' AND version = $name", {"name": name}).rows()
        }  # fmt: skip
        possible, fails = [each for each in ids if each in have], {}
        if possible:
            done = evaluate(
                self._root, possible, policy=space.policy, name=run, traffic=space.traffic, tracker=space.tracker,
                seed=space.seed, workers=self._workers, rollouts=False,
            )  # fmt: skip
            if done.broken:
                raise BadParameter("{}: could not be simulated: {}".format(*done.broken[0]))
            query = (
                f"SELECT scenario_id, ({space.failure}) FROM results JOIN metadata USING (scenario_id) WHERE run = $run"
            )
            found = Lake(self._root).sql(query, {"run": run}).rows()
            if any(not isinstance(fail, bool) for _, fail in found):
                raise QueryError(f"failure: {space.failure}: wanted true or false, found {found[0][1]!r}")
            fails = {scenario_id: int(fail) for scenario_id, fail in found}
        self._number += 1
        self._simulated += len(possible)
        if self._on_round is not None:
            self._on_round(self._number, self._simulated)
        return ids, fails
