"""Maintenance of a lake in use: rewrite files (compact), delete unused ones (vacuum), verify (fsck, upgrade)."""

from __future__ import annotations

from scenarionet_data.maintenance.bin_packing import plan_compaction
from scenarionet_data.maintenance.compaction import Compaction, compact
from scenarionet_data.maintenance.fsck import Fsck, fsck, repair
from scenarionet_data.maintenance.upgrading import Upgrade, upgrade
from scenarionet_data.maintenance.vacuuming import Vacuum, plan_vacuum, vacuum

__all__ = [
    "Compaction",
    "Fsck",
    "Upgrade",
    "Vacuum",
    "compact",
    "fsck",
    "plan_compaction",
    "plan_vacuum",
    "repair",
    "upgrade",
    "vacuum",
]
