"""The name and version of this software, as lineage and ``scenarionet --version`` give them."""

from __future__ import annotations

from importlib import metadata

PACKAGE = "scenarionet-lake"


def name_and_version() -> str:
    """For example ``scenarionet-lake 0.1.0``."""
    try:
        return f"{PACKAGE} {metadata.version(PACKAGE)}"
    except metadata.PackageNotFoundError:
        return f"{PACKAGE} (from source)"
