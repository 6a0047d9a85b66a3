"""Compiled line fits to noisy positions: a recording has a thousand fits of eleven frames each."""

from __future__ import annotations

from math import sqrt

from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.compiled.decorators import kernel

_LEAST_SPREAD = 1e-6
"""Variance of times below which a slope is undefined [s²]."""


@kernel
def fit_slopes(
    place: Array, piece: Array, times: Array, half_frames: int, half_window: float, slope: Array, certainty: Array
) -> None:
    """Fit lines to the frames around each frame, within its piece, and fill in their slopes.

    Args:
        place: (N, S) complex [m].
        piece: (N, S) number of the piece of each frame, negative where the track is not observed.
        times: (S,) [s].
        half_frames: Maximum number of frames on each side.
        half_window: Maximum seconds on each side; the adjacent frames are always used.
        slope: (N, S) complex [m/s]; zeros on entry, filled where a fit is possible.
        certainty: (N, S) root of the summed squared distances from the frames' mean time [s]; zeros on entry.
    """
    for row in range(piece.shape[0]):
        for frame in range(piece.shape[1]):
            if piece[row, frame] < 0:
                continue
            weight, since, squared, passed, moment = 0.0, 0.0, 0.0, 0j, 0j
            for other in range(max(frame - half_frames, 0), min(frame + half_frames + 1, piece.shape[1])):
                away = times[other] - times[frame]
                is_near = abs(away) <= half_window or abs(other - frame) <= 1
                if not is_near or piece[row, other] != piece[row, frame]:
                    continue
                moved = place[row, other] - place[row, frame]
                weight += 1.0
                since += away
                squared += away * away
                passed += moved
                moment += moved * away
            mean = since / weight
            spread = squared - since * mean
            if spread >= _LEAST_SPREAD:
                slope[row, frame] = (moment - passed * mean) / spread
                certainty[row, frame] = sqrt(spread)
