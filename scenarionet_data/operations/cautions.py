"""Warnings about moments that are looked for where some of them cannot be found."""

from __future__ import annotations

import json
import warnings

import pyarrow as pa
import pyarrow.compute as pc

from scenarionet_data.operations.moments import NAMED
from scenarionet_data.query.lake_view import LakeView
from scenarionet_data.query.views import dependencies
from scenarionet_data.scenario.vocabulary import ObjectType

FINE_TIMESTEP = 0.2
"""Longest timestep at which medians of seven observations are taken as short [s]."""

_KNOWN = {"ANY", *ObjectType.__members__}


class MissedMomentsWarning(UserWarning):
    """Moments may be there that are not found."""


def caution(view: LakeView, sql: str, scenarios: pa.Table) -> None:
    """Warn of timesteps that are too long for what a query reads, and of categories that no object has.

    Args:
        view: The lake.
        sql: The query of moments.
        scenarios: Those that are mined, with ``dt``.
    """
    coarse = pc.max(scenarios["dt"]).as_py() or 0.0
    if coarse > FINE_TIMESTEP + 1e-6 and "CREATE VIEW smoothed" in dependencies(sql):
        count = pc.sum(pc.greater(scenarios["dt"], FINE_TIMESTEP + 1e-6)).as_py()
        text = (
            f"{count:,} of {len(scenarios):,} scenarios have timesteps of up to {coarse:g} s; speeds and accelerations "
            f"are medians of seven, so that manoeuvres shorter than {4 * coarse:g} s are missed there"
        )
        warnings.warn(MissedMomentsWarning(text), stacklevel=3)
    named = (json.loads(values) for name, values in NAMED.findall(sql) if name == "is_category")
    if sought := {str(each["category"]).upper() for each in named} - _KNOWN:
        types = view.arrow("SELECT DISTINCT upper(source_type) AS type FROM tracks WHERE type IS NOT NULL ORDER BY 1")
        known = types["type"].to_pylist()
        for each in sorted(sought - {*known}):
            there = ", ".join((*sorted(_KNOWN), *known))
            warnings.warn(MissedMomentsWarning(f"no object is of category {each!r}; there are {there}"), stacklevel=3)
