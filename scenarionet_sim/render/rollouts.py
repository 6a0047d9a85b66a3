"""Rollouts of an evaluation run, as rows and as moments to draw."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import polars as pl

from scenarionet_data import Lake
from scenarionet_data.errors import BadParameter
from scenarionet_data.plots import Moment, Scene

_ROWS = """
    SELECT track_id, is_judged, start, x, y, heading, vx, vy, valid
    FROM rollouts
    WHERE run = $run AND scenario_id = $scenario_id AND rollout = $rollout
"""


def read_rollout(lake: Lake, run: str, scenario_id: str, rollout: int = 0) -> pl.DataFrame:
    """Return a row for each object of a rollout: track_id, is_judged, start, and lists over the episode.

    Raises:
        BadParameter: The run has no such rollout of the scenario.
    """
    rows = lake.sql(_ROWS, {"run": run, "scenario_id": scenario_id, "rollout": rollout})
    if rows.is_empty():
        runs = ", ".join(lake.sql("SELECT DISTINCT run FROM rollouts ORDER BY run")["run"]) or "none"
        raise BadParameter(f"run {run!r} has no rollout {rollout} of {scenario_id}; runs in this lake: {runs}")
    return rows


def rollout_moments(lake: Lake | str | Path, run: str, scene: Scene, rollout: int = 0) -> list[Moment]:
    """Return the moments of a scenario in a run, in order.

    Args:
        lake: The lake with the run, its path or its URL.
        run: Name of the run.
        scene: The scenario.
        rollout: Number of the rollout.

    Raises:
        BadParameter: It is no scene, or the run has no rollout of this scenario.
    """
    if not isinstance(scene, Scene):
        raise BadParameter(f"scene={scene!r}; expected what scene_of(world) returns")
    lake = lake if isinstance(lake, Lake) else Lake(lake)
    rows = read_rollout(lake, run, scene.scenario_id, rollout)
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
