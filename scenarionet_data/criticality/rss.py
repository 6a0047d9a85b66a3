"""Responsibility-sensitive safety: Shalev-Shwartz, Shammah and Shashua 2017, as in ad-rss 5.0.0."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.criticality.registry import measure
from scenarionet_data.criticality.scene import Assumptions, Meeting


def safe_distance(speed: Float64, leader_speed: Float64, limits: Assumptions) -> Float64:
    """Least longitudinal distance to one ahead in the same direction [m].

    Args:
        speed: Of the one behind [m/s], not negative.
        leader_speed: Of the one ahead [m/s], not negative.
        limits: Assumptions.
    """
    faster = speed + limits.response_time * limits.rss_acceleration
    stop = 0.5 * (speed + faster) * limits.response_time + faster**2 / (2 * limits.rss_braking)
    return np.maximum(stop - leader_speed**2 / (2 * limits.rss_leader_braking), 0.0)


def safe_lateral_distance(left_speed: Float64, right_speed: Float64, limits: Assumptions) -> Float64:
    """Least distance from the side of one object to the other on its right [m].

    Args:
        left_speed: Of the one on the left, positive to the left [m/s].
        right_speed: Of the one on the right, positive to the left [m/s].
        limits: Assumptions.
    """
    reached = np.zeros(np.shape(left_speed))
    for towards in (-left_speed, right_speed):
        late = towards + limits.response_time * limits.rss_lateral_acceleration
        reached = reached + 0.5 * (towards + late) * limits.response_time
        reached = reached + np.maximum(late, 0.0) ** 2 / (2 * limits.rss_lateral_braking)
    distance: Float64 = limits.rss_margin + np.maximum(reached, 0.0)
    return distance


@measure("rss", "", "max", "1 if hw < d_long and the sides are nearer than d_lat, else 0", "Shalev-Shwartz et al. 2017")
def is_unsafe(scene: Meeting) -> Float64:
    """Whether the one ahead is nearer than RSS demands, both along the lane and across it."""
    t = scene.traffic
    along, across = t.speed * np.cos(scene.turn), t.speed * np.sin(scene.turn)
    half = t.length / 2
    gap = (scene.s - half) - scene.own(scene.s + half)
    apart = scene.d - scene.own(scene.d)
    sides = np.abs(apart) - (t.width + scene.own(t.width)) / 2
    is_left = apart > 0
    lateral = safe_lateral_distance(
        np.where(is_left, across, scene.own(across)), np.where(is_left, scene.own(across), across), scene.limits
    )
    needed = safe_distance(np.maximum(scene.own(along), 0), np.maximum(along, 0), scene.limits)
    is_ahead = scene.s > scene.own(scene.s)
    unsafe = np.where(is_ahead & (gap < needed) & (sides < lateral), 1.0, 0.0)
    return np.where(scene.is_met, np.where(np.isnan(scene.own(scene.s)), np.nan, unsafe), np.nan)
