"""The loop that fits lines to noisy positions, compiled: a recording has a thousand fits of eleven frames each."""

from __future__ import annotations

from math import sqrt

from scenarionet_data.arrays.compiled import kernel
from scenarionet_data.arrays.dtypes import Array

_LEAST_SPREAD = 1e-6
"""s² below which the frames of a fit lie at one time."""


@kernel
def fit_slopes(
    place: Array, piece: Array, times: Array, half_frames: int, half_window: float, slope: Array, certainty: Array
) -> None:
    """Slopes of lines fitted to the frames around each one, within its piece.

    Args:
        place: (N, S) complex [m].
        piece: (N, S) number of the piece each frame belongs to, negative where the track is not seen.
        times: (S,) [s].
        half_frames: Most frames of a fit on each side.
        half_window: Most seconds on each side; the frames next to the middle count at any distance.
        slope: (N, S) complex [m/s], zeros, filled where there is something to fit.
        certainty: (N, S) zeros, filled with the root of the summed squared distances from the frames' mean time [s].
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
