"""What everybody did in a run, as moments to draw."""

from __future__ import annotations

import numpy as np

from scenarionet_data import Lake
from scenarionet_data.errors import BadParameter
from scenarionet_data.plots import Moment, Scene

_ROWS = """
    SELECT track_id, start, x, y, heading, valid FROM rollouts WHERE run = $run AND scenario_id = $scenario_id
"""


def rollout_moments(lake: Lake, run: str, scene: Scene) -> list[Moment]:
    """The moments of a scene in a run, from its first to its last.

    Raises:
        BadParameter: The run did not play this scenario.
    """
    rows = lake.sql(_ROWS, {"run": run, "scenario_id": scene.scenario_id})
    if rows.is_empty():
        runs = ", ".join(lake.sql("SELECT DISTINCT run FROM rollouts ORDER BY run")["run"]) or "none"
        raise BadParameter(f"run {run!r} holds no {scene.scenario_id}; runs of this lake: {runs}")
    row_of = {track: row for row, track in enumerate(scene.track_ids)}
    objects = [row_of[track] for track in rows["track_id"]]
    num_moments, start = len(rows["x"][0]), int(rows["start"][0])
    position = np.zeros((num_moments, scene.num_objects, 2))
    heading = np.zeros((num_moments, scene.num_objects))
    present = np.zeros((num_moments, scene.num_objects), np.bool_)
    for row, x, y, turned, valid in zip(
        objects, rows["x"], rows["y"], rows["heading"], rows["valid"].to_list(), strict=True
    ):
        position[:, row, 0], position[:, row, 1], heading[:, row] = x, y, turned
        present[:, row] = True if valid is None else valid
    return [Moment(start + step, position[step], heading[step], present[step]) for step in range(num_moments)]
