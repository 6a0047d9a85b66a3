"""Smooth motion from Argoverse 1's noisy positions at uneven times: at these times, and at 10 Hz."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarionet_data.building.motion import DT, Motion, estimate_motion, step_of
from scenarionet_data.ingest.options import Frames


def motion_of(*tracks: tuple[np.ndarray, np.ndarray], times: np.ndarray, how: Frames = "resampled") -> Motion:
    """Motion of tracks given by frame indices and positions."""
    track = np.repeat(np.arange(len(tracks)), [len(frames) for frames, _ in tracks])
    frames, positions = (np.concatenate([part[k] for part in tracks]) for k in range(2))
    return estimate_motion(track, frames, positions, times, how, np.zeros(len(track), np.bool_))


def uneven(rng: np.random.Generator, count: int = 50, step: float = 0.1) -> np.ndarray:
    times = np.arange(count) * step + rng.uniform(-0.012, 0.012, count)
    return times - times[0]


def line(times: np.ndarray, speed: float, heading: float) -> np.ndarray:
    return 2000.0 + times[:, None] * speed * np.array([np.cos(heading), np.sin(heading)])


def test_steady_drive_is_recovered_exactly() -> None:
    times = uneven(np.random.default_rng(0))
    frames = np.arange(50)
    found = motion_of((frames, line(times, 12.0, 2.0)), times=times)
    assert len(found.timestamps) == 50
    np.testing.assert_allclose(np.diff(found.timestamps), DT)
    assert found.valid.all()
    assert found.is_interpolated[0].tolist() == [False] + [True] * 49
    np.testing.assert_allclose(found.position[0], line(found.timestamps, 12.0, 2.0), atol=1e-9)
    np.testing.assert_allclose(found.velocity[0], 12.0 * np.array([[np.cos(2.0), np.sin(2.0)]] * 50), atol=1e-8)
    np.testing.assert_allclose(found.course[0], 2.0, atol=1e-9)


def test_recorded_frames_are_kept() -> None:
    rng = np.random.default_rng(3)
    times, seen = uneven(rng), np.delete(np.arange(50), slice(10, 20))
    position = line(times[seen], 9.0, 1.0) + rng.normal(0.0, 0.1, (40, 2))
    found = motion_of((np.arange(50), line(times, 12.0, 2.0)), (seen, position), times=times, how="recorded")
    np.testing.assert_array_equal(found.timestamps, times)
    np.testing.assert_array_equal(found.position[1, seen], position)
    assert np.flatnonzero(found.valid[1]).tolist() == seen.tolist()
    assert not found.is_interpolated.any()
    np.testing.assert_allclose(found.velocity[0], 12.0 * np.array([[np.cos(2.0), np.sin(2.0)]] * 50), atol=1e-8)
    np.testing.assert_allclose(found.course[0], 2.0, atol=1e-9)


def test_scatter_is_smoothed_and_stationary_objects_have_no_course() -> None:
    rng = np.random.default_rng(1)
    times, frames = uneven(rng), np.arange(50)
    noise = rng.normal(0.0, 0.1, (2, 50, 2))
    standing = np.full((50, 2), 500.0) + noise[0]
    found = motion_of((frames, standing), (frames, line(times, 8.0, -1.0) + noise[1]), times=times)
    assert found.has_course.tolist() == [False, True]
    assert (found.course[0] == 0).all()
    error = found.velocity[1] - 8.0 * np.array([np.cos(-1.0), np.sin(-1.0)])
    assert np.median(np.hypot(*error.T)) < 0.2  # finite differences would be off by 1.4 m/s
    assert np.abs(found.course[1] + 1.0).max() < 0.1
    assert np.hypot(*found.velocity[0].T).max() < 1.0


def test_stopping_object_keeps_its_driving_direction() -> None:
    times, frames = np.arange(50) * 0.1, np.arange(50)
    position = line(np.minimum(times, 2.0), 10.0, 0.7)
    found = motion_of((frames, position), times=times)
    np.testing.assert_allclose(found.course[0], 0.7, atol=1e-6)
    assert np.hypot(*found.velocity[0, -10:].T).max() < 1e-6


def test_gaps_and_single_frames_are_kept() -> None:
    times = np.arange(50) * 0.1
    gappy = np.delete(np.arange(50), slice(10, 20))
    flicker = np.arange(0, 50, 2)
    alone = np.array([30])
    found = motion_of(
        (gappy, line(times[gappy], 5.0, 0.0)),
        (flicker, line(times[flicker], 5.0, 0.0)),
        (alone, line(times[alone], 5.0, 0.0)),
        times=times,
    )
    assert np.flatnonzero(found.valid[0]).tolist() == gappy.tolist()
    assert np.flatnonzero(found.valid[1]).tolist() == flicker.tolist()
    assert np.flatnonzero(found.valid[2]).tolist() == [30]
    np.testing.assert_allclose(found.velocity[1, flicker], [[5.0, 0.0]] * 25, atol=1e-8)
    assert not found.velocity[2, 30].any()
    assert not found.has_course[2]


@pytest.mark.parametrize("at", [1, 2, 25, 48, 49])
def test_position_jump_gives_no_speed(at: int) -> None:
    times, frames = np.arange(50) * 0.1, np.arange(50)
    position = line(times, 6.0, 0.3)
    position[at:] += [15.0, -15.0]
    found = motion_of((frames, position), times=times)
    np.testing.assert_allclose(np.hypot(*found.velocity[0].T), 6.0, atol=1e-6)
    np.testing.assert_allclose(found.course[0], 0.3, atol=1e-6)


def test_recordings_with_lost_frames_keep_their_time() -> None:
    times = uneven(np.random.default_rng(2), step=0.28)
    frames = np.arange(50)
    found = motion_of((frames, line(times, 9.0, 1.0)), times=times)
    assert found.timestamps[-1] == pytest.approx(times[-1], abs=DT / 2)
    assert found.valid.all()
    np.testing.assert_allclose(found.position[0], line(found.timestamps, 9.0, 1.0), atol=1e-8)
    assert step_of(times[19]) == round(times[19] * 10)


def test_longer_interruptions_are_not_interpolated() -> None:
    times = np.concatenate([np.arange(25) * 0.1, 4.0 + np.arange(25) * 0.1])
    found = motion_of((np.arange(50), line(times, 9.0, 1.0)), times=times)
    assert np.flatnonzero(~found.valid[0]).tolist() == list(range(25, 40))


@given(st.data())
def test_every_observation_maps_to_a_step_within_half_a_step(data: st.DataObject) -> None:
    steps = data.draw(st.lists(st.floats(0.07, 0.47), min_size=19, max_size=49))
    times = np.concatenate([[0.0], np.cumsum(steps)])
    frames = np.array(sorted(data.draw(st.sets(st.integers(0, len(times) - 1), min_size=1))))
    found = motion_of((frames, line(times[frames], 7.0, 0.5)), times=times)
    valid = found.timestamps[found.valid[0]]
    assert np.abs(times[frames][:, None] - valid).min(axis=1).max() <= DT / 2 + 1e-6
    seen = times[frames]
    assert ((valid >= seen[0] - DT / 2 - 1e-6) & (valid <= seen[-1] + DT / 2 + 1e-6)).all()
    assert np.isfinite(found.position[found.valid]).all()
