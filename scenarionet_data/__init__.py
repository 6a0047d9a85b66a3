"""Traffic scenarios as data: typed arrays, converters, the lake, its queries and its loader.

from scenarionet_data import Lake

lake = Lake("lake")
busy = lake.filter("ego_distance > 10 AND num_objects > 200", name="busy")
scenario = busy[0]
"""

from __future__ import annotations

import importlib
import sys
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from scenarionet_data import errors, plots
    from scenarionet_data.building import MapBuilder, make_features, make_origin, make_tracks, resample
    from scenarionet_data.building.plausible import find_bad_rows
    from scenarionet_data.conversion import convert, plan_conversion
    from scenarionet_data.converters.base import Budgets, Converter, find_files
    from scenarionet_data.export import export_database
    from scenarionet_data.ingest.defects import Defects
    from scenarionet_data.ingest.options import Options
    from scenarionet_data.ingest.passed_over import PassedOver
    from scenarionet_data.ingest.shard import RawItem, Shard, bucket, fingerprint
    from scenarionet_data.lake.database import Database
    from scenarionet_data.lake.lake import Lake
    from scenarionet_data.loader import ScenarioLoader
    from scenarionet_data.maintenance.compaction import compact
    from scenarionet_data.maintenance.fsck import fsck
    from scenarionet_data.maintenance.upgrading import upgrade
    from scenarionet_data.maintenance.vacuuming import vacuum
    from scenarionet_data.packs.verifying import verify_pack
    from scenarionet_data.quality.checks import run_checks
    from scenarionet_data.quality.scorecard import make_scorecard
    from scenarionet_data.samples.choices import Agents, Augmentation, Polylines, Targets, TimeWindow
    from scenarionet_data.samples.dataset import SampleLayout, Samples
    from scenarionet_data.samples.order import Shuffling
    from scenarionet_data.scenario.description import ScenarioDescription
    from scenarionet_data.scenario.parts import Lights, MapFeatures, Source, Tracks, make_scenario_id
    from scenarionet_data.scenario.vocabulary import LightState, MapFeatureType, ObjectType

    __version__: str

_HOME = {
    "Agents": "scenarionet_data.samples.choices",
    "Augmentation": "scenarionet_data.samples.choices",
    "Budgets": "scenarionet_data.converters.base",
    "Converter": "scenarionet_data.converters.base",
    "Database": "scenarionet_data.lake.database",
    "Defects": "scenarionet_data.ingest.defects",
    "Lake": "scenarionet_data.lake.lake",
    "LightState": "scenarionet_data.scenario.vocabulary",
    "Lights": "scenarionet_data.scenario.parts",
    "MapBuilder": "scenarionet_data.building",
    "MapFeatureType": "scenarionet_data.scenario.vocabulary",
    "MapFeatures": "scenarionet_data.scenario.parts",
    "ObjectType": "scenarionet_data.scenario.vocabulary",
    "Options": "scenarionet_data.ingest.options",
    "PassedOver": "scenarionet_data.ingest.passed_over",
    "Polylines": "scenarionet_data.samples.choices",
    "RawItem": "scenarionet_data.ingest.shard",
    "SampleLayout": "scenarionet_data.samples.dataset",
    "Samples": "scenarionet_data.samples.dataset",
    "ScenarioDescription": "scenarionet_data.scenario.description",
    "ScenarioLoader": "scenarionet_data.loader",
    "Shard": "scenarionet_data.ingest.shard",
    "Shuffling": "scenarionet_data.samples.order",
    "Source": "scenarionet_data.scenario.parts",
    "Targets": "scenarionet_data.samples.choices",
    "TimeWindow": "scenarionet_data.samples.choices",
    "Tracks": "scenarionet_data.scenario.parts",
    "bucket": "scenarionet_data.ingest.shard",
    "compact": "scenarionet_data.maintenance",
    "convert": "scenarionet_data.conversion",
    "export_database": "scenarionet_data.export",
    "find_bad_rows": "scenarionet_data.building.plausible",
    "find_files": "scenarionet_data.converters.base",
    "fingerprint": "scenarionet_data.ingest.shard",
    "fsck": "scenarionet_data.maintenance",
    "make_features": "scenarionet_data.building",
    "make_origin": "scenarionet_data.building",
    "make_scenario_id": "scenarionet_data.scenario.parts",
    "make_scorecard": "scenarionet_data.quality.scorecard",
    "make_tracks": "scenarionet_data.building",
    "plan_conversion": "scenarionet_data.conversion",
    "resample": "scenarionet_data.building",
    "run_checks": "scenarionet_data.quality.checks",
    "upgrade": "scenarionet_data.maintenance",
    "vacuum": "scenarionet_data.maintenance",
    "verify_pack": "scenarionet_data.packs.verifying",
}
_MODULES = ("errors", "plots")

__all__ = [
    "Agents",
    "Augmentation",
    "Budgets",
    "Converter",
    "Database",
    "Defects",
    "Lake",
    "LightState",
    "Lights",
    "MapBuilder",
    "MapFeatureType",
    "MapFeatures",
    "ObjectType",
    "Options",
    "PassedOver",
    "Polylines",
    "RawItem",
    "SampleLayout",
    "Samples",
    "ScenarioDescription",
    "ScenarioLoader",
    "Shard",
    "Shuffling",
    "Source",
    "Targets",
    "TimeWindow",
    "Tracks",
    "__version__",
    "bucket",
    "compact",
    "convert",
    "errors",
    "export_database",
    "find_bad_rows",
    "find_files",
    "fingerprint",
    "fsck",
    "make_features",
    "make_origin",
    "make_scenario_id",
    "make_scorecard",
    "make_tracks",
    "plan_conversion",
    "plots",
    "resample",
    "run_checks",
    "upgrade",
    "vacuum",
    "verify_pack",
]


def __getattr__(name: str) -> Any:
    """Import a public name on first use: a converter needs no DuckDB, and ``--help`` needs nothing."""
    if name == "__version__":
        return importlib.import_module("scenarionet_data.version").__version__
    if name in _MODULES:
        return importlib.import_module(f"scenarionet_data.{name}")
    if name not in _HOME:
        raise AttributeError(f"scenarionet_data has no {name!r}; it has {', '.join(__all__)}")
    return getattr(importlib.import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)


_CARDS = {
    "Database": "database_card",
    "Lake": "lake_card",
    "ScenarioDescription": "scenario_card",
    "ScenarioLoader": "loader_card",
}
"""Functions of ``display`` that make the HTML of a class."""


def _show_in_notebooks() -> None:
    """Register the HTML of scenarios, lakes and databases with a running IPython."""
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython else None
    if shell is None:
        return
    html = shell.display_formatter.formatters["text/html"]
    for name, function in _CARDS.items():
        html.for_type_by_name(_HOME[name], name, _card(function))


def _card(function: str) -> Any:
    def card(shown: Any) -> str:
        html: str = getattr(importlib.import_module("scenarionet_data.display"), function)(shown)
        return html

    return card


_show_in_notebooks()
