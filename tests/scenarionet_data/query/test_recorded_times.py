"""Recorded times that are not multiples of dt: columns, durations of events, checks of estimated velocities."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scenarionet_data import Lake
from scenarionet_data.quality.checks import run_checks
from tests.fixtures.lakes import write_lake
from tests.fixtures.scenarios import make_scenario


def test_mean_and_longest_step_are_those_of_the_recording(tmp_path: Path) -> None:
    steps = np.arange(11) * 0.1
    clocks = steps, steps + np.where(steps > 0.45, 0.37, 0.0)
    scenarios = [replace(make_scenario(k, num_steps=11), timestamps=clock) for k, clock in enumerate(clocks)]
    lake = Lake(write_lake(tmp_path, scenarios))
    found = lake.sql("SELECT mean_step, longest_step FROM metadata ORDER BY scenario_id").rows()
    assert found == [pytest.approx((0.1, 0.1)), pytest.approx((0.137, 0.47))]
    assert lake.sql("SELECT sum(num_timesteps * mean_step) AS s FROM metadata")["s"][0] == pytest.approx(1.1 + 1.507)


def test_estimated_velocities_are_no_evidence(tmp_path: Path) -> None:
    scenario = make_scenario(5, num_objects=6)
    tracks = replace(scenario.tracks, velocity=(scenario.tracks.velocity * 1.5).astype(np.float32))
    estimated = replace(tracks, is_velocity_estimated=np.ones(len(tracks), np.bool_))
    for chosen, count in ((tracks, 1), (estimated, 0)):
        lake = write_lake(tmp_path / str(count), [replace(scenario, tracks=chosen)])
        (result,) = run_checks(lake, names=["velocity_is_motion"]).results
        assert result.num_scenarios == count
