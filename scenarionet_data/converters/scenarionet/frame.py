"""Coordinate frame and origin of a pickle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Bool, Float64
from scenarionet_data.building import METRES, make_origin


@dataclass(frozen=True)
class Frame:
    """Translations between the frames of the source, the pickle and the scenario, with the same axes.

    Attributes:
        dataset: The original dataset, for example ``"nuscenes"``.
        is_ours: Written by this project's export, with additional fields.
        has_z: Whether the pickle has heights.
        shift: (3,) from the pickle's frame to the source's [m].
        origin: (3,) from the scenario's frame to the source's [m].
        moved: (3,) translation that MetaDrive applied to tracks, lines, areas and lights, but not to stop signs [m].
    """

    dataset: str
    is_ours: bool
    has_z: bool
    shift: Float64
    origin: Float64
    moved: Float64

    @property
    def quirks(self) -> str:
        """Dataset whose ScenarioNet converter shaped the map; none for this project's export."""
        return "" if self.is_ours else self.dataset

    @property
    def local_origin(self) -> Float64:
        """(3,) the scenario's origin in the pickle's frame [m]."""
        return self.origin - self.shift

    @property
    def ground(self) -> float:
        """Height of the source's z = 0 in the pickle's frame [m], for points without z."""
        return float(-self.shift[2])


def find_frame(description: Mapping[str, Any], ego_position: Array, ego_valid: Bool, has_z: bool) -> Frame:
    """Determine the frame of a pickle.

    This project's export stores the scenario's ``origin``. MetaDrive moves a scenario to the ego's first position on
    loading; pickled after that, it has ``old_origin_in_current_coordinate``.

    Args:
        description: The pickle.
        ego_position: (T, 3) in the pickle's frame [m].
        ego_valid: (T,).
        has_z: Whether the pickle has heights, unless it states so itself.
    """
    metadata = description["metadata"]
    has_z = bool(metadata.get("has_z", has_z))
    moved = np.zeros(3)
    if "old_origin_in_current_coordinate" in metadata:
        moved[:2] = np.asarray(metadata["old_origin_in_current_coordinate"], dtype=np.float64)[:2]
    shift = -moved
    if "origin" in metadata:
        origin = np.asarray(metadata["origin"], dtype=np.float64)
        shift = origin - moved
    else:
        # Rounded as in the lake: a position next to half a metre has the same origin when exported and read again.
        origin = make_origin(np.round((ego_position + shift) / METRES) * METRES, ego_valid, has_z)
    dataset = str(metadata.get("dataset", description["version"]))
    return Frame(dataset, "scenario_uid" in metadata, has_z, shift, origin, moved)
