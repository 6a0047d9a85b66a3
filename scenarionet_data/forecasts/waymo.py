"""Scores of the Waymo Open Motion challenges: of one object, or of several together (joint predictions).

Source: https://github.com/waymo-research/waymo-open-dataset, ``metrics/motion_metrics.cc`` and
``motion_metrics_utils.cc`` (1.6).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
import shapely

from scenarionet_data.arrays.dtypes import Bool, Float64, Int64
from scenarionet_data.arrays.geometry import box_corners, rotate, wrap_angle
from scenarionet_data.scenario.parts import Tracks

STATIONARY, STRAIGHT, STRAIGHT_LEFT, STRAIGHT_RIGHT, LEFT_U_TURN, LEFT_TURN, RIGHT_U_TURN, RIGHT_TURN = range(8)
"""Shapes of recorded trajectories."""
_PRIORITY = {
    kind: rank
    for rank, kind in enumerate(
        (STATIONARY, STRAIGHT, STRAIGHT_RIGHT, STRAIGHT_LEFT, RIGHT_TURN, LEFT_TURN, LEFT_U_TURN, RIGHT_U_TURN)
    )
}
_SLOW, _NEAR, _LATERAL, _TURN = 2.0, 3.0, 2.5, np.pi / 6
"""Limits of a stationary [m/s, m] and of a straight [m, rad] trajectory."""


@dataclass(frozen=True)
class Horizon:
    """A time at which predictions are measured.

    Attributes:
        seconds: Name of the horizon [s].
        step: Predicted position, from 0.
        lateral, longitudinal: Errors beyond which a prediction misses [m], for fast objects.
    """

    seconds: float
    step: int
    lateral: float
    longitudinal: float


@dataclass(frozen=True)
class WaymoChallenge:
    """Configuration of a challenge; by default that of 2021 to 2025.

    Attributes:
        stride: Recorded timesteps from one predicted position to the next.
        max_modes: Modes that count, the first ones as given.
        horizons: Times of measurement.
        speeds: Speeds between which the limits of a miss grow [m/s].
        scales: Factors of the limits at these speeds.
    """

    stride: int = 5
    max_modes: int = 6
    horizons: tuple[Horizon, ...] = (Horizon(3, 5, 1.0, 2.0), Horizon(5, 9, 1.8, 3.6), Horizon(8, 15, 3.0, 6.0))
    speeds: tuple[float, float] = (1.4, 11.0)
    scales: tuple[float, float] = (0.5, 1.0)


@dataclass(frozen=True)
class Measurement:
    """Scores of one prediction at one horizon; NaN where the recording does not allow to measure.

    Attributes:
        min_ade, min_fde: Smallest mean error up to the horizon, and error at it, over the modes [m].
        miss: 1 if every mode misses.
        overlap: 1 if the most probable mode overlaps a recorded object.
        shape: Shape of the recorded trajectory, by which average precision is averaged; None if unknown.
        samples: (confidence, whether it matches) of each mode that can be measured, by descending confidence.
    """

    min_ade: float
    min_fde: float
    miss: float
    overlap: float
    shape: int | None
    samples: tuple[tuple[float, bool], ...]


def measure(
    tracks: Tracks,
    now: int,
    rows: Sequence[int],
    modes: Float64,
    confidences: Float64,
    at: Horizon,
    challenge: WaymoChallenge,
) -> Measurement:
    """Measure the prediction of one object, or of several together.

    Args:
        tracks: The recorded objects.
        now: Last timestep of the history.
        rows: (M,) rows of the predicted objects.
        modes: (K, M, P, 2) [m] predicted positions, the first one ``stride`` timesteps after ``now``.
        confidences: (K,).
        at: The horizon.
        challenge: Its configuration.
    """
    objects = np.asarray(rows)
    steps = now + challenge.stride * np.arange(1, at.step + 2)
    truth = tracks.position[objects][:, steps, :2].astype(np.float64)
    valid: Bool = tracks.valid[objects][:, steps]
    kept = modes[: challenge.max_modes, :, : at.step + 1]
    confidences = confidences[: challenge.max_modes]
    error = np.linalg.norm(kept - truth, axis=-1)
    counts = valid.sum(axis=1)
    can_average, can_end = bool((counts > 0).all()), bool(valid[:, -1].all())
    average = (error * valid).sum(axis=-1) / np.maximum(counts, 1)
    is_match = _matches(tracks, now, objects, kept[:, :, -1] - truth[:, -1], steps[-1], at, challenge)
    order = np.argsort(-confidences, kind="stable")
    return Measurement(
        min_ade=float(average.mean(axis=1).min()) if can_average else np.nan,
        min_fde=float(error[..., -1].mean(axis=1).min()) if can_end else np.nan,
        miss=float(not is_match.any()) if can_end else np.nan,
        overlap=float(_overlaps(tracks, now, objects, modes[int(np.argmax(confidences))], steps)),
        shape=_joint_shape(tracks, now, objects),
        samples=tuple((float(confidences[k]), bool(is_match[k])) for k in order) if can_end else (),
    )


def _matches(
    tracks: Tracks, now: int, rows: Int64, error: Float64, step: int, at: Horizon, challenge: WaymoChallenge
) -> Bool:
    """(K,) whether the errors (K, M, 2) of a mode are within the limits, which depend on the speed now."""
    own = np.abs(rotate(error, -tracks.heading[rows, step].astype(np.float64)))
    speed = np.hypot(*tracks.velocity[rows, now].astype(np.float64).T)
    scale = np.interp(speed, challenge.speeds, challenge.scales)[:, None]
    within: Bool = (own / scale <= [at.longitudinal, at.lateral]).all(axis=(1, 2))
    return within


def _overlaps(tracks: Tracks, now: int, rows: Int64, mode: Float64, steps: Int64) -> bool:
    """Whether the boxes of a mode (M, P, 2) overlap, at any of the steps, recorded objects that are seen now."""
    for row, path in zip(rows.tolist(), mode, strict=True):
        others = np.flatnonzero(tracks.valid[:, now])
        others = others[others != row]
        heading = _path_headings(path)
        for place, step in enumerate(steps.tolist()):
            seen = others[tracks.valid[others, step]]
            size = tracks.size[row, step, :2].astype(np.float64)
            centres, sizes = tracks.position[seen, step, :2].astype(np.float64), tracks.size[seen, step, :2]
            reach = (np.hypot(*size) + np.hypot(*sizes.astype(np.float64).T)) / 2
            near = np.hypot(*(centres - path[place]).T) <= reach
            if not near.any():
                continue
            box = shapely.polygons(box_corners(path[place], heading[place], size[0], size[1]))
            boxes = shapely.polygons(
                box_corners(centres[near], tracks.heading[seen[near], step], sizes[near, 0], sizes[near, 1])
            )
            if (shapely.area(shapely.intersection(box, boxes)) > 0).any():
                return True
    return False


def _path_headings(path: Float64) -> Float64:
    """(P,) directions of a path: in between, the mean of the directions before and after a position."""
    if len(path) < 2:
        return np.zeros(len(path))
    direction = np.arctan2(*np.diff(path, axis=0).T[::-1])
    before, after = np.append(direction[:1], direction), np.append(direction, direction[-1:])
    found: Float64 = np.arctan2(np.sin(before) + np.sin(after), np.cos(before) + np.cos(after))
    return found


def _joint_shape(tracks: Tracks, now: int, rows: Int64) -> int | None:
    shapes = [shape for row in rows.tolist() if (shape := trajectory_shape(tracks, row, now)) is not None]
    if not shapes:
        return None
    found = max([STATIONARY, *shapes], key=_PRIORITY.__getitem__)
    return RIGHT_TURN if found == RIGHT_U_TURN else found


def trajectory_shape(tracks: Tracks, row: int, now: int) -> int | None:
    """Shape of a recorded trajectory from now to its last state; None if it is not seen at both."""
    later = np.flatnonzero(tracks.valid[row, now + 1 :])
    if not len(later) or not tracks.valid[row, now]:
        return None
    end = now + 1 + int(later[-1])
    heading = tracks.heading[row].astype(np.float64)
    moved = (tracks.position[row, end] - tracks.position[row, now])[:2].astype(np.float64)
    along, aside = rotate(moved, -heading[now])
    speed = np.hypot(*tracks.velocity[row, [now, end]].astype(np.float64).T).max()
    if speed < _SLOW and np.hypot(*moved) < _NEAR:
        return STATIONARY
    if abs(wrap_angle(heading[end] - heading[now])) < _TURN:
        if abs(aside) < _LATERAL:
            return STRAIGHT
        return STRAIGHT_RIGHT if aside < 0 else STRAIGHT_LEFT
    if aside < 0:
        return RIGHT_U_TURN if along < 0 else RIGHT_TURN
    return LEFT_U_TURN if along < 0 else LEFT_TURN


@dataclass
class AveragePrecision:
    """Mean average precision of many predictions: over the shapes of their recorded trajectories.

    Attributes:
        is_soft: Further matches of an object are ignored, rather than counted as wrong.
    """

    is_soft: bool = False
    _samples: dict[int, list[tuple[float, bool]]] = field(default_factory=lambda: defaultdict(list))
    _counts: dict[int, int] = field(default_factory=lambda: defaultdict(int))

    def add(self, measurement: Measurement) -> None:
        """Add a prediction."""
        if measurement.shape is None or not measurement.samples:
            return
        has_match = False
        for confidence, is_match in measurement.samples:
            if not (self.is_soft and is_match and has_match):
                self._samples[measurement.shape].append((confidence, is_match and not has_match))
            has_match |= is_match
        self._counts[measurement.shape] += 1

    def value(self) -> float:
        """The mean over the shapes that occur; 0 without any."""
        found = [_average_precision(self._samples[shape], self._counts[shape]) for shape in self._counts]
        return float(np.mean(found)) if found else 0.0


def _average_precision(samples: Iterable[tuple[float, bool]], count: int) -> float:
    """Area below the precision over recall; of equal confidences, wrong ones come first."""
    ordered = sorted(samples, key=lambda sample: (-sample[0], sample[1]))
    right = np.cumsum([is_match for _, is_match in ordered])
    precision, recall = right / np.arange(1, len(ordered) + 1), right / count
    area, best, reached = 0.0, precision[-1], recall[-1]
    for each, place in zip(precision[::-1], recall[::-1], strict=True):
        if each > best:
            area += best * (reached - place)
            best, reached = each, place
    return float(area + best * reached)
