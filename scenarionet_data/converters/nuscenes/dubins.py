"""nuScenes' lane centrelines: Dubins paths of three arcs or straights each, and the points along them.

A lane is one path or several, end to end. A path is stated by its first pose, one radius, the shape (``LSR``:
left arc, straight, right arc) and the length of each of the three segments. Within a segment the heading grows by
the curvature (1/radius to the left, -1/radius to the right, 0) times the way travelled.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64, Int64
from scenarionet_data.arrays.ragged import Ragged

Path = Mapping[str, Any]

SPACING = 1.0
"""Largest distance [m] between points of a centreline; on the tightest turns (4 m) the chord is 3 cm off."""

_TURNS = {"L": 1.0, "S": 0.0, "R": -1.0}


def centerlines(lanes: Sequence[Sequence[Path]], spacing: float = SPACING) -> Ragged:
    """Points along the lanes, with each lane's first and last.

    Args:
        lanes: K lists of paths, as in ``arcline_path_3``; an empty one gives no points.
        spacing: Largest distance between points of a path [m].

    Returns:
        K lines of (n, 2) float64 [m].

    Raises:
        KeyError, TypeError, ValueError: A path is not laid out like one.
    """
    paths = [path for lane in lanes for path in lane]
    if not paths:
        return Ragged(np.zeros(len(lanes) + 1, np.int32), np.zeros((0, 2)))
    poses, lengths, curvature = _segments(paths)
    total = lengths.sum(axis=1)
    counts = np.maximum(np.ceil(total / spacing - 1e-9).astype(np.int64), 1) + 1
    path = np.repeat(np.arange(len(paths)), counts)
    index = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    travelled = total[path] * index / (counts - 1)[path]
    starts = np.cumsum(lengths, axis=1) - lengths
    segment = (travelled[:, None] >= starts[path, 1:]).sum(axis=1)
    points = advance(poses[path, segment], curvature[path, segment], travelled - starts[path, segment])[:, :2]
    lane = np.repeat(np.arange(len(lanes)), [len(lane) for lane in lanes])
    kept = ~_is_joint(points, index, lane[path])
    return Ragged.from_flat(np.bincount(lane[path][kept], minlength=len(lanes)).tolist(), points[kept])


def _segments(paths: Sequence[Path]) -> tuple[Float64, Float64, Float64]:
    """First pose (P, 3, 3), length (P, 3) [m] and curvature (P, 3) [1/m] of the three segments of each path."""
    lengths = np.array([path["segment_length"] for path in paths], np.float64).reshape(-1, 3)
    radius = np.array([path["radius"] for path in paths], np.float64)
    turns = np.array([[_TURNS[letter] for letter in path["shape"]] for path in paths]).reshape(-1, 3)
    poses = np.zeros((len(paths), 3, 3))
    poses[:, 0] = np.array([path["start_pose"] for path in paths], np.float64)
    if not (np.isfinite(poses).all() and (radius > 0).all() and ((lengths >= 0) & (lengths < np.inf)).all()):
        raise ValueError("a path that is not finite, or has a negative length or radius")
    curvature = turns / radius[:, None]
    for number in (0, 1):  # each segment begins where the one before ends
        poses[:, number + 1] = advance(poses[:, number], curvature[:, number], lengths[:, number])
    return poses, lengths, curvature


def advance(poses: Float64, curvature: Float64, length: Float64) -> Float64:
    """Poses (n, 3) x, y [m], heading [rad] after ``length`` (n,) [m] at constant ``curvature`` (n,) [1/m].

    The chord of an arc that turns by ``t`` is ``length sin(t/2) / (t/2)`` long and points along the middle of the
    turn; written with sinc, the straight line needs no case of its own.
    """
    half = curvature * length / 2.0
    chord = length * np.sinc(half / np.pi)
    middle = poses[:, 2] + half
    return np.stack(
        [poses[:, 0] + chord * np.cos(middle), poses[:, 1] + chord * np.sin(middle), poses[:, 2] + 2.0 * half],
        axis=-1,
    )


def _is_joint(points: Float64, index: Int64, lane: Int64) -> Bool:
    """True for the first point of a path that repeats the last one of the lane's path before (within 1 cm)."""
    step = np.hypot(*np.diff(points, axis=0, prepend=np.inf).T)
    same_lane = np.concatenate([[False], lane[1:] == lane[:-1]])
    joint: Bool = (index == 0) & same_lane & (step < 0.01)
    return joint
