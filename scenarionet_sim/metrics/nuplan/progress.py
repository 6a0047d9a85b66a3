"""Progress along the lanes of the recorded drive: nuPlan's ``ego_progress_along_expert_route``.

Source: nuplan-devkit, ``planning/metrics/evaluation_metrics/common/ego_progress_along_expert_route.py`` (definitions).
Its maps know road blocks, the lanes of one direction side by side; here whatever is beside a lane within 10 m is in
its road block.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.compiled.decorators import kernel
from scenarionet_sim.metrics.lane_links import LaneLinks, LaneRows, locate_on_line
from scenarionet_sim.metrics.nuplan.scoring import progress_ratio

_BESIDE = 10.0  # [m]


@dataclass(frozen=True, eq=False)
class ExpertRoute:
    """Centrelines that a recording drives along, one after another.

    Attributes:
        lines: K lines: points (P, 2), and the arc length (P,) of each [m].
        offsets: Progress at the start of each [m].
    """

    lines: Sequence[tuple[Float64, Float64]]
    offsets: Sequence[float]

    @classmethod
    def of(cls, graph: LaneLinks | None, route: Sequence[LaneRows], position: Float64) -> ExpertRoute:
        """Return the route of a recording; without a map it is the way itself.

        Args:
            graph: The lanes of the map.
            route: Lanes of the recording, as of ``DrivenLanes``.
            position: (T, 2) of the recording [m].
        """
        if graph is None:
            way = np.append(0.0, np.cumsum(np.hypot(*np.diff(position, axis=0).T)))
            return cls([(position, way)], [0.0])
        last, lines = -1, list[tuple[Float64, Float64]]()
        offsets: list[float] = []
        leaves = np.zeros(2)  # where the recording was last on the lane
        for lanes, here in zip(route, position, strict=True):
            lane = lanes[0] if lanes else -1
            if lane not in (-1, last) and graph.roads.lanes.lengths[lane] > 1:
                line, offset = graph.line(lane), 0.0
                if lines:
                    joint = (lines[-1][0][-1] if lane in graph.after(last) else leaves)[None]
                    offset = float(offsets[-1] + _located(joint, lines[-1])[0, 0] - _located(joint, line)[0, 0])
                lines.append(line)
                offsets.append(offset)
                last = lane
            if lane == last:
                leaves = here
        return cls(lines, offsets)

    def progress(self, position: Float64) -> float:
        """Progress of a drive [m]: to where it was last in the road block of a line, in the order of the lines.

        Args:
            position: (T, 2) [m].
        """
        located = np.stack([_located(position, line) for line in self.lines])
        lengths = np.array([along[-1] for _, along in self.lines])
        return _progress(located, lengths, np.array(self.offsets))

    def ratio(self, driven: Float64, recorded: Float64) -> float:
        """Share of the recorded progress; 1 if the recording is on no lane, which gives no route.

        Args:
            driven, recorded: (T, 2) positions of the driver, and of the recording [m].
        """
        return progress_ratio(self.progress(driven), self.progress(recorded)) if self.lines else 1.0


def _located(position: Float64, line: tuple[Float64, Float64]) -> Float64:
    """(2, T) arc length and distance of the point of a line nearest to each position (T, 2) [m]."""
    found = np.empty((2, len(position)))
    locate_on_line(np.ascontiguousarray(position), *line, found[0], found[1])
    return found


@kernel(allocates=False)
def _progress(located: Float64, lengths: Float64, offsets: Float64) -> float:
    """Return the progress of a drive by where it is (K, 2, T) on lines of some lengths (K,) that begin at offsets."""
    current, reached = 0, located[0, 0, 0]
    for t in range(1, located.shape[2]):
        for k in range(current, len(lengths)):  # a line that was left is not entered again
            arc = located[k, 0, t]
            if 0.0 < arc < lengths[k] and located[k, 1, t] < _BESIDE:
                current, reached = k, offsets[k] + arc
                break
    return float(reached - located[0, 0, 0])
