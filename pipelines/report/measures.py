"""The numbers of scenarios that a report looks at, as arrays: their distributions, and who is typical or extreme."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenarionet_data import Lake, tables

Float64 = npt.NDArray[np.float64]

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
_LEAST_SHARE, _MOST_SHARE = 0.002, 0.998
_FAR = 1.5
"""Outliers are cut off where they would make the axis this much longer."""

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

    ids: npt.NDArray[np.object_]
    values: dict[str, Float64]


@dataclass(frozen=True)
class Distribution:
    """How often a measure has which value, in several databases on the same bins.

    Attributes:
        column, title, unit: What is measured.
        edges: (B + 1,) of the bins; what lies beyond the outer ones is counted in them.
        shares: (D, B) of each database's scenarios that have a number.
        missing: (D,) scenarios without.
        is_cut: Whether something lies beyond the outer edges.
    """

    column: str
    title: str
    unit: str
    edges: Float64
    shares: Float64
    missing: tuple[int, ...]
    is_cut: bool


def measure(lake: Lake) -> Measured:
    """The measures of a lake's scenarios, or of those it shows."""
    rows = lake.arrow(f"SELECT scenario_id, {', '.join(COLUMNS)} FROM metadata ORDER BY scenario_id")
    values = {name: rows[name].to_numpy(zero_copy_only=False).astype(np.float64) for name in COLUMNS}
    for column in values.values():
        column[~np.isfinite(column)] = np.nan
    return Measured(np.array(rows["scenario_id"].to_pylist(), dtype=object), values)


def distributions(measured: list[Measured]) -> list[Distribution]:
    """A distribution of each column that has different numbers; see :func:`constants`."""
    metadata = tables.load("metadata")
    units = {column.name: column.unit for column in (*metadata.columns, *metadata.derived)}
    found = []
    for name, title in COLUMNS.items():
        columns = [each.values[name] for each in measured]
        numbers = _numbers(columns)
        if len(numbers) and numbers.min() < numbers.max():
            found.append(_distribution(name, title, units[name], columns, numbers))
    return found


def constants(measured: list[Measured]) -> dict[str, float]:
    """Titles of the columns that have one and the same number everywhere, with it."""
    numbers = {title: _numbers([each.values[name] for each in measured]) for name, title in COLUMNS.items()}
    return {title: float(each[0]) for title, each in numbers.items() if len(each) and each.min() == each.max()}


def _numbers(columns: list[Float64]) -> Float64:
    together: Float64 = np.concatenate(columns) if columns else np.zeros(0)
    return together[np.isfinite(together)]


def _distribution(name: str, title: str, unit: str, columns: list[Float64], numbers: Float64) -> Distribution:
    edges = _edges(numbers)
    counts = [np.histogram(column[np.isfinite(column)].clip(edges[0], edges[-1]), edges)[0] for column in columns]
    shares = np.array([count / max(count.sum(), 1) for count in counts])
    missing = tuple(int(np.isnan(column).sum()) for column in columns)
    is_cut = bool(numbers.min() < edges[0] or numbers.max() > edges[-1])
    return Distribution(name, title, unit, edges, shares, missing, is_cut)


def _edges(numbers: Float64) -> Float64:
    """Bins over all numbers but far outliers; of one whole number or more where all of them are whole."""
    low, high = np.quantile(numbers, (_LEAST_SHARE, _MOST_SHARE))
    whole = numbers.max() - numbers.min()
    if whole <= _FAR * (high - low):
        low, high = numbers.min(), numbers.max()
    if (numbers == np.round(numbers)).all():
        low, high = np.floor(low), np.ceil(high)
        step = max(1.0, np.ceil((high - low + 1) / _NUM_BINS))
        edges: Float64 = np.arange(low - 0.5, high + step, step)
        return edges
    if low == high:
        high = numbers.max()
        low = numbers.min() if low == high else low
    return np.linspace(low, high, _NUM_BINS + 1)


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
