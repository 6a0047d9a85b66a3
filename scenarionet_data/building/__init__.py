"""Build the canonical arrays of a scenario from a source's values; used by converters.

Canonical: float32 offsets from the origin, wrapped headings, zeros where not valid, ids as str.
"""

from __future__ import annotations

from scenarionet_data.building.features import flat_points, make_features
from scenarionet_data.building.map_builder import MapBuilder, meets
from scenarionet_data.building.precision import METRES, make_origin, offsets_from, rounded
from scenarionet_data.building.resampling import EGO_GAP, Resampling, bridge_gaps, resample
from scenarionet_data.building.tracks import StateGrid, make_tracks

__all__ = [
    "EGO_GAP",
    "METRES",
    "MapBuilder",
    "Resampling",
    "StateGrid",
    "bridge_gaps",
    "flat_points",
    "make_features",
    "make_origin",
    "make_tracks",
    "meets",
    "offsets_from",
    "resample",
    "rounded",
]
