"""Runs of ``scenarionet sim`` as rollouts of the challenge on simulated agents."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import polars as pl

from scenarionet_data.errors import BadParameter, InvalidScenario
from scenarionet_data.lake.lake import Lake
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_sim.metrics.wosac.scoring import challenge_id, challenge_steps, drives_on, object_numbers
from scenarionet_sim.metrics.wosac.submission import ScenarioRollouts

_SCENARIOS = """
    SELECT DISTINCT scenario_id
    FROM rollouts
    WHERE run = $run
    ORDER BY scenario_id
"""
_TRAJECTORIES = """
    SELECT rollout, track_id, start, x, y, heading, vx, vy, valid
    FROM rollouts
    WHERE run = $run AND scenario_id = $scenario_id
"""


def rollouts_of_run(lake: Lake, run: str) -> Iterator[ScenarioRollouts]:
    """Return the rollouts of every scenario of a run with the episode ``wosac``.

    All objects observed at the end of the history are in them. Those that the run does not simulate to the end stay
    where they were last present, or drive on, see ``scoring.drives_on``; heights are those at the end of the history.

    Args:
        lake: The lake with the run and the recordings.
        run: Name of the run.

    Raises:
        BadParameter: The run has no trajectories.
        InvalidScenario: The run has another episode than the challenge.
    """
    ids = lake.sql(_SCENARIOS, {"run": run})["scenario_id"].to_list()
    if not ids:
        raise BadParameter(
            f"run {run!r} has no trajectories; simulate some with episode='wosac'",
            cli_remedy="scenarionet sim LAKE --episode wosac --rollouts 32",
        )
    loader = lake.loader(ids)
    for number, scenario_id in enumerate(ids):
        rows = lake.sql(_TRAJECTORIES, {"run": run, "scenario_id": scenario_id})
        yield _rollouts(challenge_steps(loader[number]), rows)


def _rollouts(scenario: ScenarioDescription, rows: pl.DataFrame) -> ScenarioRollouts:
    tracks, now = scenario.tracks, scenario.current_timestep
    expected = scenario.num_timesteps - now - 1
    found = int(rows["start"][0]), len(rows["x"][0]) - 1
    if found != (now, expected):
        reason = f"expected {expected} steps from timestep {now}, found {found[1]} from {found[0]}"
        reason += "; simulate with the episode wosac"
        raise InvalidScenario(scenario.id, "rollouts", reason)
    observed = np.flatnonzero(tracks.valid[:, now])
    ids = object_numbers(scenario)[observed]
    observed, ids = observed[np.argsort(ids)], np.sort(ids)
    row_of = {name: row for row, name in enumerate(tracks.ids[observed].tolist())}
    numbers = sorted(rows["rollout"].unique().to_list())
    # (R, N, T, 3) x, y, heading: an object that was not driven stays where the history ends.
    last = np.column_stack((tracks.position[observed, now, :2], tracks.heading[observed, now])).astype(np.float64)
    states = np.tile(last[None, :, None], (len(numbers), 1, expected + 1, 1))
    for number, name, x, y, heading, vx, vy, valid in rows.drop("start").iter_rows():
        if name in row_of:
            present = np.ones(len(x), np.bool_) if valid is None else np.array(valid)
            seen = np.maximum.accumulate(np.where(present, np.arange(len(x)), -1))  # held while it is absent
            motion = np.array([x, y, heading, vx, vy])[:, seen]
            if drives_on(scenario):
                motion[:2] += scenario.dt * (np.arange(len(x)) - seen) * motion[3:]
            states[numbers.index(number), row_of[name], seen >= 0] = motion[:3, seen >= 0].T
    height = tracks.position[observed, now, 2] + scenario.origin[2]
    shape = (*states.shape[:2], expected)
    position = np.stack(
        [
            states[:, :, 1:, 0] + scenario.origin[0],
            states[:, :, 1:, 1] + scenario.origin[1],
            np.broadcast_to(height[None, :, None], shape),
        ],
        axis=-1,
    )
    heading = states[:, :, 1:, 2].astype(np.float32)
    return ScenarioRollouts(challenge_id(scenario), ids, position.astype(np.float32), heading)
