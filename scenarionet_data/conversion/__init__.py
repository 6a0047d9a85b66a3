"""Convert raw recordings into a lake: ``driver`` plans, runs the shards with an executor, commits and reports."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from scenarionet_data.conversion.driver import convert, plan_conversion
    from scenarionet_data.conversion.jobs import ShardJob, ShardResult, convert_shard
    from scenarionet_data.conversion.pace import Pace, measure_pace
    from scenarionet_data.conversion.plan import ConversionPlan
    from scenarionet_data.conversion.report import ConversionReport
    from scenarionet_data.conversion.selection import InputSelection, parse_slice
    from scenarionet_data.conversion.watching import watch

_MODULES = {
    "ConversionPlan": "plan",
    "ConversionReport": "report",
    "InputSelection": "selection",
    "Pace": "pace",
    "ShardJob": "jobs",
    "ShardResult": "jobs",
    "convert": "driver",
    "convert_shard": "jobs",
    "measure_pace": "pace",
    "parse_slice": "selection",
    "plan_conversion": "driver",
    "watch": "watching",
}

__all__ = [
    "ConversionPlan",
    "ConversionReport",
    "InputSelection",
    "Pace",
    "ShardJob",
    "ShardResult",
    "convert",
    "convert_shard",
    "measure_pace",
    "parse_slice",
    "plan_conversion",
    "watch",
]


def __getattr__(name: str) -> Any:
    """Import on first use: a worker process has to follow its parent before it imports anything heavy."""
    if name not in _MODULES:
        raise AttributeError(f"scenarionet_data.conversion has no {name!r}; it has {', '.join(__all__)}")
    return getattr(importlib.import_module(f"scenarionet_data.conversion.{_MODULES[name]}"), name)
