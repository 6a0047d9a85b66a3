"""Input properties from a database's ``dataset_summary.pkl``."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any

from scenarionet_data.converters.scenarionet.unpickling import load
from scenarionet_data.errors import InvalidScenario
from scenarionet_data.ingest.input_properties import InputProperties, LazyProperties

SUMMARY = "dataset_summary.pkl"
SUMMARISED = {"dataset": "dataset", "location": "map", "log": "log_name", "date": "date"}
"""Input properties by name, and their keys in the summary."""


def properties_of(pickle: Path) -> InputProperties:
    """Return the properties of a scenario from the summary in its folder; read lazily."""
    return LazyProperties({}, tuple(SUMMARISED), _fact, pickle)


def _fact(pickle: Path, key: str) -> str | tuple[str, ...]:
    metadata = _summary(pickle.parent).get(pickle.name)
    value = metadata.get(SUMMARISED[key]) if isinstance(metadata, dict) else None
    return () if value is None else str(value)


@lru_cache(maxsize=2)
def _summary(folder: Path) -> dict[str, Any]:
    """Metadata by file name; empty if the summary is missing or unreadable."""
    path = folder / SUMMARY
    try:
        return load(path, path.name)
    except InvalidScenario:  # the scenarios can be converted without a summary
        return {}
