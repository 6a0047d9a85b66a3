"""Traffic scenarios as data: typed arrays, converters, the lake, its queries and its loader.

from scenarionet_data import Lake, ScenarioLoader

lake = Lake("lake")
busy = lake.filter("ego_distance > 10 AND num_objects > 200", name="busy")
scenario = ScenarioLoader(lake, busy)[0]
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from scenarionet_data.conversion import convert
    from scenarionet_data.databases.record import Database
    from scenarionet_data.lake.lake import Lake
    from scenarionet_data.loader import ScenarioLoader
    from scenarionet_data.scenario.description import ScenarioDescription

__all__ = ["Database", "Lake", "ScenarioDescription", "ScenarioLoader", "convert"]

_HOME = {
    "Database": "scenarionet_data.databases.record",
    "Lake": "scenarionet_data.lake.lake",
    "ScenarioDescription": "scenarionet_data.scenario.description",
    "ScenarioLoader": "scenarionet_data.loader",
    "convert": "scenarionet_data.conversion",
}


def __getattr__(name: str) -> Any:
    """Import on first use: a converter needs no DuckDB, and ``--help`` needs nothing."""
    if name not in _HOME:
        raise AttributeError(f"scenarionet_data has no {name!r}; it has {', '.join(__all__)}")
    return getattr(importlib.import_module(_HOME[name]), name)
