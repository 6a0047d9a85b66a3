"""Progress along the lanes of the recorded drive: nuPlan's ``ego_progress_along_expert_route``.

Source: nuplan-devkit, ``planning/metrics/evaluation_metrics/common/ego_progress_along_expert_route.py`` (definitions).
Its maps know road blocks, the lanes of one direction side by side; here whatever is beside a lane within 10 m is in
its road block.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_sim.metrics.lane_links import LaneLinks, LaneRows
from scenarionet_sim.metrics.nuplan.scoring import progress_ratio

_BESIDE = 10.0  # [m]


@dataclass(frozen=True, eq=False)
class ExpertRoute:
    """Centrelines that a recording drives along, one after another.

    Attributes:
        lines: K lines [m].
        offsets: Progress at the start of each [m].
    """

    lines: Sequence[shapely.LineString]
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
            return cls([shapely.LineString(position)], [0.0])
        points, last = graph.roads.lanes, -1
        lines: list[shapely.LineString] = []
        offsets: list[float] = []
        leaves = np.zeros(2)  # where the recording was last on the lane
        for lanes, here in zip(route, position, strict=True):
            lane = lanes[0] if lanes else -1
            if lane not in (-1, last) and len(points[lane]) > 1:
                line, offset = shapely.LineString(points[lane].astype(np.float64)), 0.0
                if lines:
                    follows = lane in graph.after(last)
                    joint = shapely.Point(lines[-1].coords[-1] if follows else leaves)
                    offset = offsets[-1] + lines[-1].project(joint) - line.project(joint)
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
        lines, points = np.array(self.lines)[:, None], shapely.points(position)
        arc = shapely.line_locate_point(lines, points)
        is_inside = (arc > 0.0) & (arc < shapely.length(lines)) & (shapely.distance(lines, points) < _BESIDE)
        line, reached = 0, float(arc[0, 0])
        for step in range(1, len(position)):  # a line that was left is not entered again
            later = np.flatnonzero(is_inside[line:, step])
            if len(later):
                line += int(later[0])
                reached = self.offsets[line] + float(arc[line, step])
        return reached - float(arc[0, 0])

    def ratio(self, driven: Float64, recorded: Float64) -> float:
        """Share of the recorded progress; 1 if the recording is on no lane, which gives no route.

        Args:
            driven, recorded: (T, 2) positions of the driver, and of the recording [m].
        """
        return progress_ratio(self.progress(driven), self.progress(recorded)) if self.lines else 1.0
