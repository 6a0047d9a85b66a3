"""Speed, acceleration and curvature of tracks over time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.errors import BadParameter
from scenarionet_data.plots.palette import EGO, SERIES
from scenarionet_data.plots.style import new_figure, plain, styled
from scenarionet_data.scenario.description import ScenarioDescription, check_scenario

_LEAST_SPEED = 1.0
"""Minimum speed for a meaningful curvature [m/s]."""


@dataclass(frozen=True, eq=False)
class TrackProfile:
    """Motion of one track over time; NaN where undefined.

    Attributes:
        speed: (T,) [m/s].
        acceleration: (T,) [m/s²] longitudinal.
        curvature: (T,) [1/m] positive to the left; undefined below 1 m/s.
    """

    speed: Float64
    acceleration: Float64
    curvature: Float64


def profile(scenario: ScenarioDescription, track_id: str) -> TrackProfile:
    """Return the profile of a track.

    Speed is the norm of the recorded velocity, the other values are central differences between valid timesteps.

    Raises:
        BadParameter: The track does not exist.
    """
    tracks = scenario.tracks
    if track_id not in tracks.ids:
        raise BadParameter(f"{scenario.id}: no track {track_id!r}; there are {', '.join(tracks.ids[:5])}, ...")
    row = tracks.index(track_id)
    valid = tracks.valid[row]
    speed = np.where(valid, np.hypot(*tracks.velocity[row].T.astype(np.float64)), np.nan)
    heading = np.full(len(valid), np.nan)
    heading[valid] = np.unwrap(tracks.heading[row][valid].astype(np.float64))
    turning = _rate(heading, scenario.timestamps)
    curvature = np.full_like(speed, np.nan)
    is_driving = speed > _LEAST_SPEED  # False for NaN
    curvature[is_driving] = turning[is_driving] / speed[is_driving]
    return TrackProfile(speed, _rate(speed, scenario.timestamps), curvature)


def draw_profiles(scenario: ScenarioDescription, track_ids: Sequence[str] | None = None) -> Figure:
    """Draw speed, acceleration and curvature of tracks over time.

    Args:
        scenario: The scenario.
        track_ids: Ids of the tracks; the ego by default.

    Raises:
        BadParameter: It is no scenario, or the track does not exist.
    """
    if not isinstance(track_ids, Sequence | None):
        raise BadParameter(f"track_ids: expected ids of tracks, found {track_ids!r}")
    chosen = list(track_ids or [check_scenario(scenario).ego_id])
    found = {track_id: profile(scenario, track_id) for track_id in chosen}
    others = iter([color for color in SERIES if color != EGO] * len(chosen))
    colors = {track_id: EGO if track_id == scenario.ego_id else next(others) for track_id in chosen}
    with styled():
        figure = new_figure(6.4, 5.0, layout="constrained")
        panels = figure.subplots(3, 1, sharex=True)
        measures = (
            ("speed", "speed [m/s]"),
            ("acceleration", "acceleration\n[m/s²]"),
            ("curvature", "curvature\n[1/m]"),
        )
        for panel, (name, words) in zip(panels, measures, strict=True):
            for track_id, each in found.items():
                is_ego = track_id == scenario.ego_id
                label = f"{plain(track_id, 20)} (the ego)" if is_ego and track_id != "ego" else plain(track_id, 20)
                values = getattr(each, name)
                marker = "o" if np.isfinite(values).sum() == 1 else ""
                panel.plot(
                    scenario.timestamps, values, color=colors[track_id], label=label, marker=marker, linewidth=1.6
                )
            panel.set_ylabel(words)
            if not any(np.isfinite(getattr(each, name)).any() for each in found.values()):
                panel.text(0.5, 0.5, "cannot be told", transform=panel.transAxes, ha="center", va="center")
        panels[0].axvline(scenario.timestamps[scenario.current_timestep], color="0.6", linestyle=":", label="now")
        panels[0].set_title(plain(scenario.id, 60))
        panels[0].legend(loc="best", ncols=min(len(chosen) + 1, 4))
        panels[2].set_xlabel("time [s]")
        figure.align_ylabels()
    return figure


def _rate(values: Float64, timestamps: Float64) -> Float64:
    """Time derivative (T,); NaN next to invalid timesteps and for a single timestep."""
    if len(values) < 2:
        return np.full_like(values, np.nan)
    return np.gradient(values, timestamps)
