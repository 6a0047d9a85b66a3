"""Name and version of the distribution, as recorded in lineage and printed by ``scenarionet --version``."""

from __future__ import annotations

PACKAGE = "scenarionet-lake"

__version__ = "0.2.0"
"""The only place that states the version; the build backend reads it from this line."""

NAME_AND_VERSION = f"{PACKAGE} {__version__}"


def name_and_version() -> str:
    """Return for example ``scenarionet-lake 0.2.0``."""
    return NAME_AND_VERSION
