"""Build the canonical arrays of a scenario from a source's values; used by converters.

Canonical: float32 offsets from the origin, wrapped headings, zeros where not valid, ids as str.
"""

from __future__ import annotations

from scenarionet_data.building.features import flat_points, make_features
from scenarionet_data.building.map_builder import MapBuilder, meets
from scenarionet_data.building.precision import METRES, make_origin, offsets_from, rounded
from scenarionet_data.building.resampling import Resampling, resample, short_gaps
from scenarionet_data.building.tracks import StateGrid, make_tracks

__all__ = [
    "METRES",
    "MapBuilder",
    "Resampling",
    "StateGrid",
    "flat_points",
    "make_features",
    "make_origin",
    "make_tracks",
    "meets",
    "offsets_from",
    "resample",
    "rounded",
    "short_gaps",
]
