"""Sample nuScenes' lane centrelines, which are Dubins paths of three arcs or straight segments each.

A lane is a sequence of paths. A path is defined by its start pose, a radius, a shape (``LSR``: left arc, straight,
right arc) and the length of each of the three segments. The heading changes by the curvature (1/radius to the left,
-1/radius to the right, or 0) times the distance travelled.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64, Int64
from scenarionet_data.arrays.ragged import Ragged

DubinsPath = Mapping[str, Any]

SPACING = 1.0
"""Maximum distance between points of a centreline [m]; on the tightest turns (4 m) chords deviate by 3 cm."""

_LONGEST = 10_000.0
"""Longest segment [m], so that the number of points is bounded."""
_LARGEST = 1e7
"""Largest coordinate or radius [m]."""
_TURNS = {"L": 1.0, "S": 0.0, "R": -1.0}


def centerlines(lanes: Sequence[Sequence[DubinsPath]], spacing: float = SPACING) -> Ragged:
    """Sample points along lanes, including the first and last point.

    Args:
        lanes: K lists of paths, as in ``arcline_path_3``, see :func:`are_paths`; an empty list gives no points.
        spacing: Maximum distance between points of a path [m].

    Returns:
        K lines of (n, 2) float64 [m].

    """
    paths = [path for lane in lanes for path in lane]
    if not paths:
        return Ragged(np.zeros(len(lanes) + 1, np.int32), np.zeros((0, 2)))
    lengths = np.array([path["segment_length"] for path in paths], np.float64).reshape(-1, 3)
    radius = np.array([path["radius"] for path in paths], np.float64)
    turns = np.array([[_TURNS[letter] for letter in path["shape"]] for path in paths]).reshape(-1, 3)
    poses = np.zeros((len(paths), 3, 3))
    poses[:, 0] = np.array([path["start_pose"] for path in paths], np.float64)
    curvature = turns / radius[:, None]
    for number in (0, 1):  # each segment starts at the end of the previous one
        poses[:, number + 1] = advance(poses[:, number], curvature[:, number], lengths[:, number])
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


def are_paths(paths: Sequence[Any]) -> bool:
    """Whether all values are paths with finite numbers of a plausible size."""
    try:
        poses, lengths, radius = (
            np.array([path[name] for path in paths]) for name in ("start_pose", "segment_length", "radius")
        )
        shapes = {path["shape"] for path in paths}
    except (TypeError, KeyError, ValueError):
        return False
    numbers = (poses, lengths, radius)
    return (
        [each.shape[1:] for each in numbers] == [(3,), (3,), ()]
        and all(each.dtype.kind in "if" and (np.abs(each) < _LARGEST).all() for each in numbers)
        and bool((radius > 0).all() and (lengths >= 0).all() and (lengths <= _LONGEST).all())
        and all(isinstance(shape, str) and len(shape) == 3 and set(shape) <= set(_TURNS) for shape in shapes)
    )


def advance(poses: Float64, curvature: Float64, length: Float64) -> Float64:
    """Poses (n, 3) x, y [m], heading [rad] after ``length`` (n,) [m] at constant ``curvature`` (n,) [1/m].

    The chord of an arc with turning angle ``t`` has length ``length sin(t/2) / (t/2)`` and the mean heading; with sinc,
    straight lines need no special case.
    """
    half = curvature * length / 2.0
    chord = length * np.sinc(half / np.pi)
    middle = poses[:, 2] + half
    return np.stack(
        [poses[:, 0] + chord * np.cos(middle), poses[:, 1] + chord * np.sin(middle), poses[:, 2] + 2.0 * half],
        axis=-1,
    )


def _is_joint(points: Float64, index: Int64, lane: Int64) -> Bool:
    """Whether the first point of a path repeats the last one of the lane's previous path (within 1 cm)."""
    step = np.hypot(*np.diff(points, axis=0, prepend=np.inf).T)
    same_lane = np.concatenate([[False], lane[1:] == lane[:-1]])
    joint: Bool = (index == 0) & same_lane & (step < 0.01)
    return joint
