"""Convert raw recordings into a lake: ``driver`` plans, runs the shards with an executor, commits and reports."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenarionet_data.public_names import import_on_first_use

if TYPE_CHECKING:
    from scenarionet_data.conversion.committer import ConversionReport as ConversionReport
    from scenarionet_data.conversion.driver import convert as convert
    from scenarionet_data.conversion.driver import plan_conversion as plan_conversion
    from scenarionet_data.conversion.jobs import ShardJob as ShardJob
    from scenarionet_data.conversion.jobs import ShardResult as ShardResult
    from scenarionet_data.conversion.jobs import convert_shard as convert_shard
    from scenarionet_data.conversion.pace import Pace as Pace
    from scenarionet_data.conversion.pace import measure_pace as measure_pace
    from scenarionet_data.conversion.plan import ConversionPlan as ConversionPlan
    from scenarionet_data.conversion.plan import InputSelection as InputSelection
    from scenarionet_data.conversion.plan import parse_slice as parse_slice
    from scenarionet_data.conversion.watching import watch as watch

# A worker process has to follow its parent before it imports anything heavy.
__getattr__, __dir__, __all__ = import_on_first_use(__name__, __file__)
