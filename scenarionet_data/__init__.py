"""Traffic scenarios as data: typed arrays, converters, the lake, its queries and its loader.

from scenarionet_data import Lake

lake = Lake("lake")
busy = lake.filter("ego_distance > 10 AND num_objects > 200", name="busy")
scenario = busy[0]
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenarionet_data.public_names import import_on_first_use

if TYPE_CHECKING:
    from scenarionet_data import errors as errors
    from scenarionet_data import plots as plots
    from scenarionet_data.building import MapBuilder as MapBuilder
    from scenarionet_data.building import make_features as make_features
    from scenarionet_data.building import make_origin as make_origin
    from scenarionet_data.building import make_tracks as make_tracks
    from scenarionet_data.building import resample as resample
    from scenarionet_data.building.plausible import find_bad_rows as find_bad_rows
    from scenarionet_data.conversion import convert as convert
    from scenarionet_data.conversion import plan_conversion as plan_conversion
    from scenarionet_data.conversion.adding import add_scenarios as add_scenarios
    from scenarionet_data.converters.base import Budgets as Budgets
    from scenarionet_data.converters.base import Converter as Converter
    from scenarionet_data.converters.base import find_files as find_files
    from scenarionet_data.export import export_database as export_database
    from scenarionet_data.ingest.defects import Defects as Defects
    from scenarionet_data.ingest.options import Options as Options
    from scenarionet_data.ingest.passed_over import PassedOver as PassedOver
    from scenarionet_data.ingest.shard import RawItem as RawItem
    from scenarionet_data.ingest.shard import Shard as Shard
    from scenarionet_data.ingest.shard import bucket as bucket
    from scenarionet_data.ingest.shard import fingerprint as fingerprint
    from scenarionet_data.lake.database import Database as Database
    from scenarionet_data.lake.lake import Lake as Lake
    from scenarionet_data.loader import ScenarioLoader as ScenarioLoader
    from scenarionet_data.maintenance.compaction import compact as compact
    from scenarionet_data.maintenance.fsck import fsck as fsck
    from scenarionet_data.maintenance.upgrading import upgrade as upgrade
    from scenarionet_data.maintenance.vacuuming import vacuum as vacuum
    from scenarionet_data.packs.verifying import verify_pack as verify_pack
    from scenarionet_data.quality.checks import run_checks as run_checks
    from scenarionet_data.quality.scorecard import make_scorecard as make_scorecard
    from scenarionet_data.samples.choices import Agents as Agents
    from scenarionet_data.samples.choices import Augmentation as Augmentation
    from scenarionet_data.samples.choices import Polylines as Polylines
    from scenarionet_data.samples.choices import Targets as Targets
    from scenarionet_data.samples.choices import TimeWindow as TimeWindow
    from scenarionet_data.samples.dataset import SampleLayout as SampleLayout
    from scenarionet_data.samples.dataset import Samples as Samples
    from scenarionet_data.samples.order import Shuffling as Shuffling
    from scenarionet_data.scenario.description import ScenarioDescription as ScenarioDescription
    from scenarionet_data.scenario.parts import Lights as Lights
    from scenarionet_data.scenario.parts import MapFeatures as MapFeatures
    from scenarionet_data.scenario.parts import Source as Source
    from scenarionet_data.scenario.parts import Tracks as Tracks
    from scenarionet_data.scenario.parts import make_scenario_id as make_scenario_id
    from scenarionet_data.scenario.vocabulary import LightState as LightState
    from scenarionet_data.scenario.vocabulary import MapFeatureType as MapFeatureType
    from scenarionet_data.scenario.vocabulary import ObjectType as ObjectType
    from scenarionet_data.variations.drawing import VariationSpace as VariationSpace
    from scenarionet_data.variations.writing import vary as vary
    from scenarionet_data.version import __version__ as __version__

# A converter needs no DuckDB, and ``--help`` needs nothing.
__getattr__, __dir__, __all__ = import_on_first_use(__name__, __file__)
