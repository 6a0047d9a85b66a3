"""Which lane an object drives on."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scenarionet_data.procedural.jit import entry
from scenarionet_sim.kernels.order import larger, smaller

Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]
Int32 = npt.NDArray[np.int32]

_ACROSS = np.cos(np.pi / 4)  # how far a lane's direction may be from an object's heading


@entry
def find_lanes(places: Float32, headings: Float32, points: Float32, offsets: Int32, found: Float64) -> None:
    """The lane nearest to each place that leads its way.

    Args:
        places, headings: (Q, 2) [m], (Q,) [rad].
        points, offsets: (P, 2) [m], (M + 1,) centrelines.
        found: (Q, 3) row of the lane, how far along it the place is [m], how far from it; written where a lane
            is nearer than what the last column says.
    """
    for m in range(len(offsets) - 1):
        arc = 0.0
        for k in range(offsets[m], offsets[m + 1] - 1):
            tx, ty = np.float64(points[k + 1, 0]) - points[k, 0], np.float64(points[k + 1, 1]) - points[k, 1]
            length = np.hypot(tx, ty)
            if length == 0.0:
                continue
            for q in range(len(places)):
                dx, dy = np.float64(places[q, 0]) - points[k, 0], np.float64(places[q, 1]) - points[k, 1]
                along = smaller(larger((tx * dx + ty * dy) / length, 0.0), length)
                apart = np.hypot(dx - along * tx / length, dy - along * ty / length)
                leads = np.cos(headings[q]) * tx + np.sin(headings[q]) * ty > _ACROSS * length
                if leads and apart < found[q, 2]:
                    found[q, 0], found[q, 1], found[q, 2] = m, arc + along, apart
            arc += length
