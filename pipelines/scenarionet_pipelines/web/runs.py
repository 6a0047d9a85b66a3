"""Runs of ``scenarionet sim`` beside the recording: which there are of a scenario, and their motion and events."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl
import shapely

from scenarionet_data import Lake
from scenarionet_data.arrays.dtypes import Array, Bool, Float64
from scenarionet_data.arrays.geometry import box_corners, median_sizes
from scenarionet_data.errors import BadParameter
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.storage import evaluation_runs
from scenarionet_pipelines.web.packing import layout
from scenarionet_pipelines.web.rows import plain

_RESULTS = """
    SELECT
        run, rollout, track_id, error, status, outcome_time, success, cost, first_collision, off_road_time,
        nuplan_score, progress_ratio, mean_speed, min_time_to_collision, is_comfortable, average_displacement,
        (run, rollout) IN (SELECT (run, rollout) FROM rollouts WHERE scenario_id = $scenario_id) AS has_motion
    FROM results WHERE scenario_id = $scenario_id AND error IS NULL ORDER BY run, rollout, track_id
"""
_ROLLOUTS = """
    SELECT track_id, is_judged, start, x, y, heading, vx, vy, valid
    FROM rollouts WHERE run = $run AND scenario_id = $scenario_id AND rollout = $rollout
"""
_DRIVEN = 0.5
"""Distance from the recording from which an object counts as driven by the run [m]."""


def runs_of(lake: Lake, scenario_id: str) -> list[dict[str, Any]]:
    """Return outcome, metrics and their rule of every rollout of a scenario, one entry per evaluated vehicle."""
    rows = lake.sql(_RESULTS, {"scenario_id": scenario_id}).to_dicts()
    rules = {run: evaluation_runs.describe(lake.files, run).get("rule") for run in {row["run"] for row in rows}}
    return [{name: plain(value) for name, value in row.items()} | {"rule": rules[row["run"]]} for row in rows]


@dataclass(frozen=True)
class RunMotion:
    """Motion of a scenario's N objects in a rollout of T moments, in the scenario frame.

    Attributes:
        time: (T,) [s] since the first timestep of the recording.
        position: (N, T, 2) [m].
        heading: (N, T) [rad].
        velocity: (N, T, 2) [m/s].
        valid: (N, T) present.
        judged: Rows of the evaluated vehicles.
    """

    time: Float64
    position: Float64
    heading: Float64
    velocity: Float64
    valid: Bool
    judged: list[int]


def read_motion(lake: Lake, run: str, rollout: int, scenario: ScenarioDescription) -> RunMotion:
    """Read a rollout.

    Raises:
        BadParameter: The run has no such rollout of this scenario.
    """
    from scenarionet_sim.worlds.world import STEP  # importing the simulator takes a second

    rows = lake.sql(_ROLLOUTS, {"run": run, "scenario_id": scenario.id, "rollout": rollout})
    row_of = {str(name): row for row, name in enumerate(scenario.tracks.ids)}
    rows = rows.filter(pl.col("track_id").is_in(list(row_of)))
    if rows.is_empty():
        raise BadParameter(f"run {run!r} has no rollout {rollout} of {scenario.id}; choose one from the page's list")
    count, length, start = len(row_of), len(rows["x"][0]), int(rows["start"][0])
    position, velocity = np.zeros((count, length, 2)), np.zeros((count, length, 2))
    heading, valid = np.zeros((count, length)), np.zeros((count, length), np.bool_)
    judged = []
    for each in rows.iter_rows(named=True):
        row = row_of[each["track_id"]]
        position[row] = np.column_stack([each["x"], each["y"]])
        velocity[row] = np.column_stack([each["vx"], each["vy"]])
        heading[row] = each["heading"]
        valid[row] = True if each["valid"] is None else each["valid"]
        if each["is_judged"]:
            judged.append(row)
    time: Float64 = STEP * np.arange(start, start + length, dtype=np.float64)
    return RunMotion(time, position, heading, velocity, valid, judged)


def pack_run(lake: Lake, run: str, rollout: int, scenario: ScenarioDescription) -> bytes:
    """Return a rollout in the binary format of ``packing``: motion, driven objects and events.

    Raises:
        BadParameter: The run has no such rollout of this scenario.
    """
    motion = read_motion(lake, run, rollout, scenario)
    header = {
        "run": run,
        "rollout": rollout,
        "judged": motion.judged,
        "driven": np.flatnonzero(_is_driven(motion, scenario)).tolist(),
        "events": [event for row in motion.judged for event in _events(motion, row, scenario)],
    }
    arrays: dict[str, Array] = {
        "time": motion.time.astype(np.float32),
        "position": motion.position.astype(np.float32),
        "heading": motion.heading.astype(np.float32),
        "velocity": motion.velocity.astype(np.float32),
        "valid": motion.valid.astype(np.uint8),
    }
    return layout(header, arrays)


def _is_driven(motion: RunMotion, scenario: ScenarioDescription) -> Bool:
    """Return the objects (N,) that are evaluated, or that move otherwise than they were recorded."""
    tracks = scenario.tracks
    step = np.clip(np.searchsorted(scenario.timestamps, motion.time - 1e-3), 0, len(scenario.timestamps) - 1)
    is_recorded = np.abs(scenario.timestamps[step] - motion.time) < 1e-3
    both = motion.valid & tracks.valid[:, step] & is_recorded
    away = np.hypot(*np.moveaxis(motion.position - tracks.position[:, step, :2], -1, 0))
    driven: Bool = ((away > _DRIVEN) & both).any(axis=1)
    driven[motion.judged] = True
    return driven


def _events(motion: RunMotion, row: int, scenario: ScenarioDescription) -> list[dict[str, Any]]:
    """Crashes of an evaluated vehicle, and when it is off the road; times in seconds."""
    from scenarionet_sim.metrics.road import is_off_road
    from scenarionet_sim.roads.roads import Roads

    size = median_sizes(scenario.tracks.size, scenario.tracks.valid)
    corners = box_corners(motion.position, motion.heading, size[:, None, 0], size[:, None, 1])
    contacts = _contacts(motion, row, corners)
    begins = contacts[:, 1:] & ~contacts[:, :-1]  # boxes that overlap from the start belong to the recording
    found = []
    for other, step in np.argwhere(begins).tolist():
        time = float(motion.time[step + 1])
        found.append({"kind": "crash", "first": time, "last": time, "other": str(scenario.tracks.ids[other])})
    roads = Roads.from_map(scenario.map)
    if roads.is_road.any():
        is_off = is_off_road(corners[row], roads) & motion.valid[row]
        edges = np.flatnonzero(np.diff(np.concatenate([[False], is_off, [False]])))
        for begin, end in edges.reshape(-1, 2).tolist():
            first, last = float(motion.time[begin]), float(motion.time[end - 1])
            found.append({"kind": "off_road", "first": first, "last": last, "other": None})
    return sorted(found, key=lambda event: event["first"])


def _contacts(motion: RunMotion, row: int, corners: Float64) -> Bool:
    """Return when (N, T) the box of an object overlaps those of the others."""
    away = np.hypot(*np.moveaxis(motion.position - motion.position[row], -1, 0))
    reach = np.hypot(*np.moveaxis(corners[:, :, 0] - motion.position, -1, 0))
    contacts: Bool = (away < reach + reach[row]) & motion.valid & motion.valid[row]
    contacts[row] = False
    others, steps = np.nonzero(contacts)
    own = shapely.polygons(corners[row, steps])
    contacts[others, steps] = shapely.intersects(own, shapely.polygons(corners[others, steps]))
    return contacts
