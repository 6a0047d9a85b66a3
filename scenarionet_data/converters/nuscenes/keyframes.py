"""Interpolate annotations between nuScenes' keyframes (2 Hz; 5 Hz in Lyft's dataset).

The time between two keyframes is divided into equal steps, so that every keyframe is a timestep with its annotations
unchanged; keyframes have a jitter of 50 ms, so that steps last 0.09 to 0.11 s. In between, positions and sizes are
interpolated linearly and headings along the shorter arc. An object is invalid at a step unless it is annotated at both
adjacent keyframes and none is missing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64, Int64
from scenarionet_data.arrays.geometry import wrap_angle
from scenarionet_data.building import EGO_GAP

HEADING = 3
"""Column of boxes and poses with an angle."""
_REACH = 1e5
"""Longest time from a step before the first pose, or after the last, over which the ego keeps that pose [us]."""
_PERIOD = 0.5
"""Time between keyframes assumed for a scene with a single one [s]."""


@dataclass(frozen=True, eq=False)
class Steps:
    """T timesteps over K keyframes.

    Attributes:
        dt: Nominal step [s].
        times: (T,) [us], in the clock of the keyframes.
        keyframe: (T,) last keyframe at or before each step.
        share: (T,) fraction of the time to the next keyframe, 0 at a keyframe.
        is_gap: (T,) whether a keyframe is missing between the two.
    """

    dt: float
    times: Float64
    keyframe: Int64
    share: Float64
    is_gap: Bool

    @property
    def at_keyframes(self) -> Int64:
        """(K,) timestep of each keyframe."""
        return np.flatnonzero(self.share == 0)


def nominal_period(times: Float64) -> float:
    """Nominal time [s] between keyframes at ``times`` (K,) [us], in whole twentieths of a second."""
    return max(round(float(np.median(np.diff(times))) * 20e-6), 1) / 20 if len(times) > 1 else _PERIOD


def make_steps(times: Float64, period: float, rate: int | None) -> Steps:
    """Return steps over keyframes at ``times`` (K,) [us], including every keyframe.

    Args:
        times: (K,) [us].
        period: Nominal time between keyframes [s].
        rate: Steps per second; None: only the keyframes.
    """
    spans = np.diff(times)
    num_parts = 1 if rate is None else max(1, round(rate * period))
    num_periods = np.maximum(1, np.round(spans * 1e-6 / period).astype(np.int64))
    counts = np.append(np.ones_like(num_periods) if rate is None else num_periods * num_parts, 1)
    keyframe = np.repeat(np.arange(len(times)), counts)
    share = (np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)) / counts[keyframe]
    return Steps(
        dt=period / num_parts,
        times=times[keyframe] + share * np.append(spans, 0.0)[keyframe],
        keyframe=keyframe,
        share=share,
        is_gap=np.append(num_periods > 1, False)[keyframe] & (share > 0),
    )


def boxes_at(steps: Steps, boxes: Float64, seen: Bool) -> tuple[Float64, Bool]:
    """Interpolate boxes (N, K, 7) and validity (N, K) of keyframes to (N, T, 7) and (N, T) at the steps."""
    before, after = steps.keyframe, np.minimum(steps.keyframe + 1, boxes.shape[1] - 1)
    valid = seen[:, before] & (seen[:, after] | (steps.share == 0)) & ~steps.is_gap
    return _blend(boxes[:, before], boxes[:, after], steps.share), valid


def poses_at(times: Float64, pose_times: Float64, poses: Float64) -> tuple[Float64, Bool, Bool]:
    """Interpolate poses (P, 4) at ``pose_times`` (P,) to ``times`` (T,) [us].

    Returns:
        (T, 4) poses, (T,) whether they are valid, (T,) whether they are between recorded ones.
    """
    after = np.searchsorted(pose_times, times).clip(0, len(pose_times) - 1)
    before = np.where(pose_times[after] > times, np.maximum(after - 1, 0), after)
    span = pose_times[after] - pose_times[before]
    share = np.where(span > 0, (times - pose_times[before]) / np.where(span > 0, span, 1.0), 0.0)
    valid = (span <= EGO_GAP * 1e6) & is_covered(times, pose_times)
    return _blend(poses[before], poses[after], share), valid, pose_times[before] != times


def is_covered(times: Float64, pose_times: Float64) -> Bool:
    """(T,) whether ``times`` are from the first to the last of ``pose_times``, or near."""
    covered: Bool = (times >= pose_times[0] - _REACH) & (times <= pose_times[-1] + _REACH)
    return covered


def _blend(before: Float64, after: Float64, share: Float64) -> Float64:
    """(..., T, C) between ``before`` and ``after``; exactly ``before`` where ``share`` (T,) is 0."""
    change = after - before
    change[..., HEADING] = wrap_angle(change[..., HEADING])
    return before + share[:, None] * change
