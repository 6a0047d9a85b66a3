"""Recorded states on timesteps of equal length: they agree with the motion, and say what is interpolated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarionet_data.arrays.geometry import wrap_angle
from scenarionet_data.building import make_tracks, resample
from scenarionet_data.errors import BadParameter
from scenarionet_data.scenario.description import ScenarioDescription
from tests.fixtures.scenarios import make_scenario

START, SPEED, TURN = np.array([30.0, -20.0]), np.array([7.0, 3.0]), 0.9


def drive(times: np.ndarray, dt: float, valid: np.ndarray | None = None) -> ScenarioDescription:
    """Two objects that drive straight while their heading turns evenly; the ego is always seen."""
    count = len(times)
    valid = np.ones((2, count), bool) if valid is None else valid
    position = np.zeros((2, count, 3))
    position[..., :2] = START + times[:, None] * SPEED
    tracks = make_tracks(
        ["t0", "t1"],
        [1, 1],
        position,
        np.broadcast_to(2.5 + TURN * times, (2, count)),
        np.broadcast_to(SPEED, (2, count, 2)),
        np.ones((2, 3)),
        valid,
        origin=np.zeros(3),
    )
    few = make_scenario(num_steps=count, num_objects=2, num_lanes=2, num_lights=2)
    return replace(few, timestamps=times, dt=dt, tracks=tracks, origin=np.zeros(3), current_timestep=count // 2)


steps = st.lists(st.floats(0.03, 0.6), min_size=1, max_size=25)


@given(steps=steps, dt=st.sampled_from([0.05, 0.1, 0.5]))
def test_resampled_states_are_on_the_path(steps: list[float], dt: float) -> None:
    times = np.concatenate([[0.0], np.cumsum(steps)])
    scenario = drive(times, 0.1)
    found = resample(scenario, dt)
    found.validate()
    if found is scenario:
        assert np.abs(times - np.arange(len(times)) * dt).max() <= 0.05 * dt
        return
    assert found.timestamps.tolist() == [k * dt for k in range(round(times[-1] / dt) + 1)]
    assert found.tracks.valid.all()
    away = found.tracks.position[..., :2] - START - found.timestamps[:, None] * SPEED
    assert np.abs(away).max() < 1e-3
    inside = found.timestamps <= times[-1]
    assert np.abs(wrap_angle(found.tracks.heading - 2.5 - TURN * found.timestamps))[:, inside].max() < 1e-5
    assert np.abs(found.tracks.velocity - SPEED).max() < 1e-3
    is_recorded = np.abs(found.timestamps[:, None] - times).min(axis=1) < 1e-6
    assert (found.tracks.is_interpolated == ~is_recorded).all()
    last = [np.flatnonzero(times <= time + 1e-6)[-1] for time in found.timestamps]
    assert (found.lights.state == scenario.lights.state[:, last]).all()
    assert abs(found.timestamps[found.current_timestep] - times[len(times) // 2]) <= dt / 2 + 1e-6


@pytest.mark.parametrize("seed", range(3))
def test_regular_timesteps_are_kept(seed: int) -> None:
    scenario = make_scenario(seed)
    assert resample(scenario, 0.1) is scenario


def test_gaps_stay_gaps_and_short_ones_between_frames_are_bridged() -> None:
    valid = np.ones((2, 21), bool)
    valid[1, 5:9] = False
    found = resample(drive(np.arange(21) * 0.25, 0.25, valid), 0.1)
    wanted = [t for t in range(51) if not t * 0.1 - 0.05 > 1.0 or t * 0.1 + 0.05 >= 2.25]
    assert np.flatnonzero(found.tracks.valid[1]).tolist() == wanted
    far = resample(drive(np.array([0.0, 0.5, 3.0, 3.5]), 0.5), 0.1)
    assert np.flatnonzero(~far.tracks.valid[0]).tolist() == list(range(6, 30))


def test_every_second_frame_is_taken_from_twice_the_rate() -> None:
    scenario = make_scenario(2, num_steps=41)
    fast = replace(scenario, timestamps=np.arange(41) * 0.05, dt=0.05)
    found = resample(fast, 0.1)
    seen = fast.tracks.valid[:, ::2]
    assert (found.tracks.valid & seen == seen).all()
    for name in ("position", "heading", "velocity"):
        assert (getattr(found.tracks, name)[seen] == getattr(fast.tracks, name)[:, ::2][seen]).all()
    assert not found.tracks.is_interpolated[seen].any()
    assert found.tracks.is_interpolated[found.tracks.valid & ~seen].all()


@pytest.mark.parametrize("dt", [0.0, -0.1, float("nan"), float("inf")])
def test_steps_that_are_no_time_are_refused(dt: float) -> None:
    with pytest.raises(BadParameter, match="expected a timestep above 0 s"):
        resample(make_scenario(), dt)
