"""What a database's ``dataset_summary.pkl`` says of its scenarios, to choose them by before they are read."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any

from scenarionet_data.converters.scenarionet.unpickling import load
from scenarionet_data.errors import InvalidScenario
from scenarionet_data.ingest.input_properties import InputProperties, LazyProperties

SUMMARISED = {"dataset": "dataset", "location": "map", "log": "log_name", "date": "date"}
"""InputProperties, and what the summary's metadata call them."""


def properties_of(pickle: Path) -> InputProperties:
    """What the summary beside a scenario's pickle says of it; looked up when it is asked for."""
    return LazyProperties({}, tuple(SUMMARISED), _fact, pickle)


def _fact(pickle: Path, key: str) -> str | tuple[str, ...]:
    metadata = _summary(pickle.parent).get(pickle.name)
    value = metadata.get(SUMMARISED[key]) if isinstance(metadata, dict) else None
    return () if value is None else str(value)


@lru_cache(maxsize=2)
def _summary(folder: Path) -> dict[str, Any]:
    """Metadata by file name; none where there is no summary, or one that cannot be read."""
    path = folder / "dataset_summary.pkl"
    try:
        return load(path, path.name)
    except InvalidScenario:  # the scenarios themselves need no summary
        return {}
