"""Name and version of this software, for lineage and ``scenarionet --version``."""

from __future__ import annotations

from importlib import metadata

PACKAGE = "scenarionet-lake"


def version() -> str:
    """Return the installed version, or ``0+source`` for sources that are not installed."""
    try:
        return metadata.version(PACKAGE)
    except metadata.PackageNotFoundError:
        return "0+source"


def name_and_version() -> str:
    """Return for example ``scenarionet-lake 0.1.0``."""
    try:
        return f"{PACKAGE} {metadata.version(PACKAGE)}"
    except metadata.PackageNotFoundError:
        return f"{PACKAGE} (from source)"
