"""Measures of scenarios, and the selection of typical and extreme scenarios."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenarionet_data import Lake
from scenarionet_data.arrays.dtypes import Float64, Object

COLUMNS = {
    "ego_distance": "Distance driven by the ego",
    "duration": "Duration",
    "ego_mean_speed": "Mean speed of the ego",
    "ego_max_speed": "Maximum speed of the ego",
    "ego_cumulative_curvature": "Cumulative curvature of the ego",
    "difficulty": "Difficulty",
    "num_objects": "Objects",
    "num_vehicles": "Vehicles",
    "num_pedestrians": "Pedestrians",
    "num_cyclists": "Cyclists",
    "min_ego_gap": "Smallest gap to the ego",
    "num_map_features": "Map features",
}
"""Columns whose distributions are drawn, in this order, with titles."""

EXTREMES = {
    "longest route": ("ego_distance", 1),
    "fastest": ("ego_max_speed", 1),
    "most objects": ("num_objects", 1),
    "most pedestrians": ("num_pedestrians", 1),
    "most difficult": ("difficulty", 1),
    "closest to another": ("min_ego_gap", -1),
}
"""Extremes to show: a column, and 1 for its largest or -1 for its smallest value."""

_NUM_EXAMPLES = 8
_SEED = 0
"""Seed of the random scenarios, so that reports are reproducible."""


@dataclass(frozen=True)
class ScenarioMeasures:
    """Measures of S scenarios.

    Attributes:
        ids: (S,) str, scenario ids.
        values: (S,) float64 by column, NaN where missing.
    """

    ids: Object
    values: dict[str, Float64]


def read_measures(lake: Lake) -> ScenarioMeasures:
    """Read the measures of all scenarios of a lake or view."""
    rows = lake.arrow(f"SELECT scenario_id, {', '.join(COLUMNS)} FROM metadata ORDER BY scenario_id")
    values = {name: rows[name].to_numpy(zero_copy_only=False).astype(np.float64) for name in COLUMNS}
    for column in values.values():
        column[~np.isfinite(column)] = np.nan
    return ScenarioMeasures(np.array(rows["scenario_id"].to_pylist(), dtype=object), values)


def select_examples(measured: ScenarioMeasures) -> dict[str, list[tuple[str, str]]]:
    """Select typical, extreme and random scenarios; each is an id with the reason for an extreme."""
    size = len(measured.ids)
    if not size:
        return {}
    _, different = np.unique(_distance_from_median(measured), return_index=True)  # sorted, without duplicates
    typical = different[:_NUM_EXAMPLES]
    extremes: dict[str, list[str]] = {}  # a scenario with several extremes is listed once with all of them
    for reason, (name, sign) in EXTREMES.items():
        column = sign * measured.values[name]
        if np.isfinite(column).any() and np.nanmax(column) > np.nanmin(column):
            extremes.setdefault(str(measured.ids[np.nanargmax(column)]), []).append(reason)
    random = np.random.default_rng(_SEED).permutation(size)[:_NUM_EXAMPLES]
    return {
        "typical": [(str(measured.ids[row]), "") for row in typical],
        "extreme": [(scenario_id, ", ".join(reasons)) for scenario_id, reasons in extremes.items()],
        "random": [(str(measured.ids[row]), "") for row in random],
    }


def _distance_from_median(measured: ScenarioMeasures) -> Float64:
    """Distance of each scenario from the median (S,), in interquartile ranges summed over measures."""
    values = np.stack(list(measured.values.values()))
    counted = np.isfinite(values).any(axis=1)
    low, middle, high = np.nanquantile(values[counted], (0.25, 0.5, 0.75), axis=1)[..., None]
    spread = np.where(high > low, high - low, 1.0)
    away: Float64 = np.nan_to_num(np.abs(values[counted] - middle) / spread).sum(axis=0)
    return away
