"""The numbers of scenarios that a report looks at, as arrays: their distributions, and who is typical or extreme."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scenarionet_data import Lake
from scenarionet_data.arrays.dtypes import Float64, Object
from scenarionet_data.plots.distributions import Distribution, distributions
from scenarionet_data.schema import tables

COLUMNS = {
    "ego_distance": "Distance of the ego",
    "duration": "Duration",
    "ego_mean_speed": "Mean speed of the ego",
    "ego_max_speed": "Highest speed of the ego",
    "ego_cumulative_curvature": "Curvature of the ego's way",
    "difficulty": "Difficulty",
    "num_objects": "Objects",
    "num_vehicles": "Vehicles",
    "num_pedestrians": "Pedestrians",
    "num_cyclists": "Cyclists",
    "min_ego_gap": "Smallest gap to the ego",
    "num_map_features": "Map features",
}
"""What distributions are drawn of, in this order, with their titles."""

EXTREMES = {
    "longest way": ("ego_distance", 1),
    "fastest": ("ego_max_speed", 1),
    "most objects": ("num_objects", 1),
    "most pedestrians": ("num_pedestrians", 1),
    "most difficult": ("difficulty", 1),
    "closest to another": ("min_ego_gap", -1),
}
"""What a scenario can be the most of: a column, and 1 for its largest or -1 for its smallest value."""

_NUM_BINS = 24
_NUM_CHOSEN = 8
_OWN_CHANCE = 0
"""Seed of the random scenarios: a report made again shows the same."""


@dataclass(frozen=True)
class Measured:
    """The measures of some scenarios.

    Attributes:
        ids: (S,) str.
        values: By column (S,) float64, NaN where there is no number.
    """

    ids: Object
    values: dict[str, Float64]


@dataclass(frozen=True)
class Spread:
    """How often a measure has which value, group beside group.

    Attributes:
        title, unit: What is measured.
        groups: Databases, or the datasets of a lake; all on the same bins.
    """

    title: str
    unit: str
    groups: tuple[Distribution, ...]

    @property
    def shares(self) -> Float64:
        """(G, B) of each group's scenarios that have a number."""
        counts = np.array([group.counts for group in self.groups])
        shares: Float64 = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1.0)
        return shares

    @property
    def edges(self) -> Float64:
        """(B + 1,) of the bins; the outer ones hold what lies beyond, too."""
        return self.groups[0].edges

    @property
    def is_known(self) -> bool:
        """Whether any scenario has a number."""
        return bool(self.groups) and any(group.counts.any() for group in self.groups)

    @property
    def is_flat(self) -> bool:
        """Whether all numbers lie in one bin: there is nothing to draw."""
        return int(self.shares.any(axis=0).sum()) < 2

    @property
    def missing(self) -> int:
        """Scenarios without a number."""
        return sum(group.missing for group in self.groups)


def spreads(lake: Lake, databases: Sequence[str] = ()) -> list[Spread]:
    """How every measure is spread over databases, or over the datasets of the lake when none is named."""
    metadata = tables.load("metadata")
    units = {column.name: column.unit for column in (*metadata.columns, *metadata.derived)}
    return [
        Spread(title, units[name], tuple(distributions(lake, name, databases=databases, bins=_NUM_BINS)))
        for name, title in COLUMNS.items()
    ]


def measure(lake: Lake) -> Measured:
    """The measures of a lake's scenarios, or of those it shows."""
    rows = lake.arrow(f"SELECT scenario_id, {', '.join(COLUMNS)} FROM metadata ORDER BY scenario_id")
    values = {name: rows[name].to_numpy(zero_copy_only=False).astype(np.float64) for name in COLUMNS}
    for column in values.values():
        column[~np.isfinite(column)] = np.nan
    return Measured(np.array(rows["scenario_id"].to_pylist(), dtype=object), values)


def choose(measured: Measured) -> dict[str, list[tuple[str, str]]]:
    """Scenarios to show: typical, extreme and random ones, each as id and why."""
    size = len(measured.ids)
    if not size:
        return {}
    _, different = np.unique(_strangeness(measured), return_index=True)  # sorted; of copies, the first
    typical = different[:_NUM_CHOSEN]
    random = np.random.default_rng(_OWN_CHANCE).permutation(size)[:_NUM_CHOSEN]
    return {
        "typical": [(str(measured.ids[row]), "") for row in typical],
        "extreme": _extremes(measured),
        "random": [(str(measured.ids[row]), "") for row in random],
    }


def _strangeness(measured: Measured) -> Float64:
    """How far each scenario is from the median one (S,): measures in quartile distances, what is missing left out."""
    values = np.stack(list(measured.values.values()))
    counted = np.isfinite(values).any(axis=1)
    low, middle, high = np.nanquantile(values[counted], (0.25, 0.5, 0.75), axis=1)[..., None]
    spread = np.where(high > low, high - low, 1.0)
    away: Float64 = np.nan_to_num(np.abs(values[counted] - middle) / spread).sum(axis=0)
    return away


def _extremes(measured: Measured) -> list[tuple[str, str]]:
    """Whoever is the most of something, once, with everything it is the most of."""
    found: dict[str, list[str]] = {}
    for why, (name, sign) in EXTREMES.items():
        column = sign * measured.values[name]
        if np.isfinite(column).any() and np.nanmax(column) > np.nanmin(column):
            found.setdefault(str(measured.ids[np.nanargmax(column)]), []).append(why)
    return [(scenario_id, ", ".join(reasons)) for scenario_id, reasons in found.items()]
