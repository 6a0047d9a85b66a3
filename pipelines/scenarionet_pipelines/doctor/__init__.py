"""Diagnosis of an installation, of this machine, and of a lake: ``scenarionet maintain doctor``."""

from __future__ import annotations

from scenarionet_pipelines.doctor.finding import Finding

__all__ = ["Finding", "examine"]


def examine(lake: str | None = None) -> list[Finding]:
    """Check Python, packages, converters, the machine and, if given, a lake.

    Args:
        lake: Folder or URL of a lake; it need not exist.
    """
    from scenarionet_data.storage.files.places import is_url
    from scenarionet_pipelines.doctor import local

    found = [*local.examine_installation(), local.examine_ros1(), *local.examine_openpilot()]
    if lake is None or not is_url(lake):
        return [*found, *local.examine_machine(lake or "."), *(local.examine_lake(lake) if lake else ())]
    from scenarionet_data.storage.files.cache import folder_of
    from scenarionet_pipelines.doctor.remote import examine_store

    return [*found, *local.examine_machine(str(folder_of(lake))), *examine_store(lake)]
