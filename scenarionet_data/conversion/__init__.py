"""Raw recordings to a lake: ``driver`` plans, has the shards converted by an executor, commits and reports."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from scenarionet_data.conversion.driver import convert, plan_conversion
    from scenarionet_data.conversion.jobs import Job, Outcome, convert_shard
    from scenarionet_data.conversion.pace import Pace, measure_pace
    from scenarionet_data.conversion.plan import Plan
    from scenarionet_data.conversion.report import Report
    from scenarionet_data.conversion.selection import Selection, parse_slice
    from scenarionet_data.conversion.watching import watch

_HOMES = {
    "driver": ("convert", "plan_conversion"),
    "jobs": ("Job", "Outcome", "convert_shard"),
    "pace": ("Pace", "measure_pace"),
    "plan": ("Plan",),
    "report": ("Report",),
    "selection": ("Selection", "parse_slice"),
    "watching": ("watch",),
}
_HOME = {name: module for module, names in _HOMES.items() for name in names}

__all__ = [
    "Job", "Outcome", "Pace", "Plan", "Report", "Selection", "convert", "convert_shard", "measure_pace",
    "parse_slice", "plan_conversion", "watch",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    """Import on first use: a pool's process has to follow its parent before it imports anything heavy."""
    if name not in _HOME:
        raise AttributeError(f"scenarionet_data.conversion has no {name!r}; it has {', '.join(__all__)}")
    return getattr(importlib.import_module(f"scenarionet_data.conversion.{_HOME[name]}"), name)
