"""Criticality as rows: of every object, other and timestep, and the worst of each moment."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.criticality import encounters, evasion, following, rss  # noqa: F401  # they fill the table
from scenarionet_data.criticality.registry import MEASURES, CriticalityMeasure
from scenarionet_data.criticality.scene import Assumptions, Meeting, SurroundingTraffic
from scenarionet_data.errors import BadParameter
from scenarionet_data.scenario.description import ScenarioDescription

if TYPE_CHECKING:
    import polars as pl

LEFT_OUT = {
    "p_mc": "it samples manoeuvres at random",
    "p_smh": "it needs a set of sampled manoeuvres, and its authors have no code for it",
    "p_srs": "it needs stochastic reachable sets, and its authors have no code for it",
    "da": "the drivable area is a reachable set",
    "wttr": "it needs reachable sets",
    "tci": "it is the result of an optimisation",
    "pf": "it has a closed form, but of an object among lanes, borders and all others at once, and is not written",
    "sp": "its authors have no code for it",
    "ttm": "it is the family of ttb, ttk and tts, and ttr the latest of them",
    "aci": "it needs a tree of outcomes with probabilities, and its authors have no code for it",
    "pri": "it needs probabilities of pedestrians' behaviour, and its authors have no code for it",
    "cs": "its authors have no code for it",
    "tc": "its authors have no code for it",
    "tv": "its authors have no code for it",
}
"""Measures of CommonRoad-CriMe that are refused, and why."""


def find_measures(names: Sequence[str] | None) -> list[CriticalityMeasure]:
    """Return measures by name, all for None.

    Raises:
        BadParameter: A name is none of a measure.
    """
    if isinstance(names, str):
        raise BadParameter(f"measures: wanted a list of names, found {names!r}; write [{names!r}]")
    for name in names or ():
        if name not in MEASURES:
            reason = f": {LEFT_OUT[name]}" if name in LEFT_OUT else ""
            raise BadParameter(f"no measure {name!r}{reason}; there are {', '.join(MEASURES)}")
    return list(MEASURES.values()) if names is None else [MEASURES[name] for name in names]


def criticality(
    scenario: ScenarioDescription,
    measures: Sequence[str] | None = None,
    objects: Sequence[str] | None = None,
    limits: Assumptions | None = None,
) -> pl.DataFrame:
    """Compute measures of criticality of a scenario.

    Args:
        scenario: The scenario.
        measures: Names of measures, all by default.
        objects: Ids of the tracks whose criticality it is, the ego's by default.
        limits: Assumptions of the measures.

    Returns:
        One row for each object, other and timestep at which both are observed: scenario_id, track_id, other_id,
        timestep, and a float64 column for each measure: infinite where there is no conflict, NaN where it is not
        defined, as off the lanes.

    Raises:
        BadParameter: No such measure.
        KeyError: The scenario has no such track.
    """
    import polars

    wanted = find_measures(measures)
    traffic = SurroundingTraffic.of(scenario)
    ids = scenario.tracks.ids.astype(str)
    frames = []
    for track_id in [scenario.ego_id] if objects is None else objects:
        scene = Meeting(traffic, scenario.tracks.index(track_id), limits or Assumptions())
        others, steps = np.nonzero(scene.is_met)
        columns = {"other_id": ids[others], "timestep": steps.astype(np.int32)}
        values = {each.name: each.function(scene)[others, steps] for each in wanted}
        frame = polars.DataFrame(columns | values)
        frames.append(
            frame.select(
                polars.lit(scenario.id).alias("scenario_id"), polars.lit(track_id).alias("track_id"), polars.all()
            )
        )
    return polars.concat(frames)


def measure_moments(
    scenarios: Iterable[ScenarioDescription],
    moments: pl.DataFrame,
    measures: Sequence[str],
    limits: Assumptions | None = None,
) -> pl.DataFrame:
    """Add to moments the most critical value of each measure while they last.

    Args:
        scenarios: The scenarios that the moments are in.
        moments: Rows with scenario_id, track_id, first_timestep, last_timestep, and other_id or not; without another
            object, the worst of all others is meant.
        measures: Names of measures.
        limits: Assumptions of the measures.

    Returns:
        The same rows in the same order, with a float64 column for each measure; null where it is never defined.

    Raises:
        BadParameter: No such measure, or a column of that name is there already.
    """
    import polars

    wanted = find_measures(measures)
    if taken := sorted({each.name for each in wanted} & set(moments.columns)):
        raise BadParameter(f"moments have a column {taken[0]} already")
    rows = moments.with_row_index("moment").partition_by("scenario_id", as_dict=True)
    found = {each.name: np.full(len(moments), np.nan) for each in wanted}
    for scenario in scenarios:
        if (scenario.id,) not in rows:
            continue
        traffic, scenes = SurroundingTraffic.of(scenario), dict[str, Meeting]()
        for row in rows[scenario.id,].iter_rows(named=True):
            track_id, other_id = row["track_id"], row.get("other_id")
            if track_id not in scenes:
                scenes[track_id] = Meeting(traffic, scenario.tracks.index(track_id), limits or Assumptions())
            others = slice(None) if other_id is None else [scenario.tracks.index(other_id)]
            window = slice(row["first_timestep"], row["last_timestep"] + 1)
            for each in wanted:
                found[each.name][row["moment"]] = _worst(each, each.function(scenes[track_id])[others, window])
    return moments.with_columns(polars.Series(name, values).fill_nan(None) for name, values in found.items())


def _worst(measure: CriticalityMeasure, values: Float64) -> float:
    defined = values[~np.isnan(values)]
    if not defined.size:
        return np.nan
    return float(defined.min() if measure.worst == "min" else defined.max())
