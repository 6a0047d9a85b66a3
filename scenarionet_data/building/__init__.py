"""Build the canonical arrays of a scenario from a source's values; used by converters.

Canonical: float32 offsets from the origin, wrapped headings, zeros where not valid, ids as str.
"""

from __future__ import annotations

from scenarionet_data.building.features import MapBuilder, flat_points, make_features, meets
from scenarionet_data.building.resampling import EGO_GAP, Resampling, bridge_gaps, cut_steps, resample
from scenarionet_data.building.tracks import METRES, StateGrid, make_origin, make_tracks, offsets_from, rounded

__all__ = [
    "EGO_GAP",
    "METRES",
    "MapBuilder",
    "Resampling",
    "StateGrid",
    "bridge_gaps",
    "cut_steps",
    "flat_points",
    "make_features",
    "make_origin",
    "make_tracks",
    "meets",
    "offsets_from",
    "resample",
    "rounded",
]
