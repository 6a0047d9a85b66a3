"""Changes of a road user that drives at 10 m/s, or speeds up, computed by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scenarionet_data.errors import InvalidScenario
from scenarionet_data.variations.changes import change
from scenarionet_data.variations.limits import check_limits, peaks
from tests.fixtures.drives import Other, make_drive

NOW = 10  # timestep, at 1 s


@pytest.fixture(scope="module")
def drive():
    """The ego from 0 at 10 m/s for 4 s; t1 20 m before it at 8 m/s; t2 beside them at rest."""
    made = make_drive(others=(Other(20.0, vx=8.0), Other(30.0, y=3.5), Other(60.0, y=3.5, vx=5.0, first=20)))
    return replace(made, current_timestep=NOW)


def row(scenario, track):
    tracks = scenario.tracks
    k = tracks.index(track)
    return tracks.position[k, :, 0], tracks.position[k, :, 1], tracks.velocity[k], tracks.valid[k]


@pytest.mark.parametrize(
    ("word", "value", "x", "speed"),
    [
        ("speed", 1.5, lambda t: 28 + 12 * (t - 1), 12),
        ("gap", 5.0, lambda t: 25 + 8 * t, 8),
        ("pace", 0.5, lambda t: 28 + 4 * (t - 1), 4),
    ],
)
def test_along_the_path(drive, word, value, x, speed):
    """t1 is at 20 + 8 t; at the current timestep, t = 1, at 28."""
    changed, origins = change(drive, {f"t1.{word}": value})
    changed.validate()
    there, y, velocity, valid = row(changed, "t1")
    assert valid.all() and not y.any()
    assert there == pytest.approx(x(drive.timestamps), abs=1e-3)
    assert velocity[:, 0] == pytest.approx(speed, abs=1e-3)
    assert origins.tolist() == [0, -2, 2, 3]
    assert np.array_equal(changed.tracks.position[[0, 2, 3]], drive.tracks.position[[0, 2, 3]]), "the others stay"


def test_start_moves_all_states_in_time(drive):
    changed, _ = change(drive, {"t3.start": 0.5, "t1.start": -0.25})
    x, _, _, valid = row(changed, "t3")
    assert np.flatnonzero(valid)[0] == 25 and x[25] == pytest.approx(row(drive, "t3")[0][20])
    x, _, _, valid = row(changed, "t1")
    assert x[valid] == pytest.approx(20 + 8 * (drive.timestamps[valid] + 0.25), abs=1e-3)
    assert np.flatnonzero(~valid).tolist() == [38, 39, 40], "nothing is recorded after 4 s"


def test_offset_and_drift(drive):
    _, y, velocity, _ = row(change(drive, {"t1.offset": 1.2})[0], "t1")
    assert y == pytest.approx(1.2, abs=1e-4) and not velocity[:, 1].any()
    changed, _ = change(drive, {"t1.drift": -2.0})
    _, y, velocity, _ = row(changed, "t1")
    assert not y[: NOW + 1].any() and y[25] == pytest.approx(-1.0, abs=1e-3), "half of it after half the time"
    assert y[40] == pytest.approx(-2.0, abs=1e-3)
    assert velocity[25, 1] == pytest.approx(-2.0 * 1.875 / 3.0, abs=0.01), "the polynomial's largest slope is 15/8"
    assert changed.tracks.heading[1, 25] == pytest.approx(np.arctan2(-1.25, 8.0), abs=0.01)


def test_delay_grows_smoothly(drive):
    """At t = 2.5 s half of it: t1, at 20 + 8 t, is where it was 0.4 s before; its clock runs at 1 - 0.8 * 1.875 / 3."""
    changed, _ = change(drive, {"t1.delay": 0.8})
    x, y, velocity, valid = row(changed, "t1")
    assert valid.all() and not y.any()
    assert x[: NOW + 1] == pytest.approx(20 + 8 * drive.timestamps[: NOW + 1], abs=1e-3)
    assert x[25] == pytest.approx(20 + 8 * 2.1, abs=1e-3) and x[40] == pytest.approx(20 + 8 * 3.2, abs=1e-3)
    assert velocity[25, 0] == pytest.approx(8 * 0.5, abs=1e-3) and velocity[40, 0] == pytest.approx(8, abs=1e-3)
    with pytest.raises(InvalidScenario, match=r"a delay of 1\.7 s in 3 s; wanted at most 1\.6 s"):
        change(drive, {"t1.delay": 1.7})


def test_replaced_by_a_lorry_and_by_a_cyclist_that_is_too_fast(drive):
    changed, origins = change(drive, {"t1.replace": 2.0, "t3.replace": 3.0})
    changed.validate()
    assert changed.tracks.object_type.tolist() == [1, 1, 1, 3] and origins.tolist() == [0, -2, 2, -4]
    assert changed.tracks.size[1, 0] == pytest.approx([12.0, 2.55, 3.8])
    with pytest.raises(InvalidScenario, match="wanted at most 7 m/s of what replaces track t1, found 8"):
        change(drive, {"t1.replace": 4.0})


def test_size_remove_and_copy(drive):
    changed, origins = change(drive, {"t1.size": 1.5, "t2.remove": 1.0, "t1.copy": 1.0})
    changed.validate()
    assert changed.tracks.ids.tolist() == ["t0", "t1", "t3", "t1+copy"] and origins.tolist() == [0, -2, 3, -2]
    assert changed.tracks.size[1, 0] == pytest.approx([6.9, 2.85, 2.4])
    x, _, _, valid = row(changed, "t1+copy")
    assert np.flatnonzero(valid)[0] == 10 and x[30] == pytest.approx(20 + 8 * 2.0, abs=1e-3)


def test_lights_change_later():
    red = make_drive(red=True)
    state = np.array(red.lights.state)
    state[:, 20:] = 4
    red = replace(red, lights=replace(red.lights, state=state))
    changed, origins = change(red, {"lights.start": 0.5})
    assert np.array_equal(changed.lights.state[:, 5:], state[:, :-5])
    assert (changed.lights.state[:, :5] == state[:, :1]).all() and (origins >= 0).all()


def test_friction_is_a_property_of_the_road(drive):
    changed, origins = change(drive, {"road.friction": 0.5})
    assert changed.extras["friction"] == 0.5 and origins.tolist() == [0, 1, 2, 3]
    assert change(changed, {"road.friction": 0.5})[0].extras["friction"] == 0.25, "a factor, as the others"


def test_nearest_and_actors_that_are_not_there(drive):
    near, _ = change(drive, {"nearest.gap": 1.0})
    assert row(near, "t1")[0][0] == pytest.approx(21.0, abs=1e-3)
    with pytest.raises(InvalidScenario, match="wanted a track '9', found 4: t0, t1"):
        change(drive, {"9.gap": 1.0})
    with pytest.raises(InvalidScenario, match="wanted a road user near the ego"):
        change(make_drive(), {"nearest.gap": 1.0})
    with pytest.raises(InvalidScenario, match="at no timestep any more"):
        change(drive, {"t1.start": 9.0})
    with pytest.raises(InvalidScenario, match="40 m from its recorded path"):
        change(drive, {"t1.gap": 40.0})


def test_peaks_of_a_parabola(drive):
    """v = 3 t: 3 m/s^2, no jerk; v = t^2: 2 t over half a second from 3.5 to 4 s, 7.5 m/s^2, and 2 m/s^3."""
    time = drive.timestamps
    velocity = np.array(drive.tracks.velocity)
    velocity[0, :, 0], velocity[1, :, 0] = 3 * time, time**2
    tracks = replace(drive.tracks, velocity=velocity)
    acceleration, jerk = peaks(tracks, np.array([0, 1]), time, 5)
    assert acceleration == pytest.approx([3.0, 7.5], abs=1e-4) and jerk == pytest.approx([0.0, 2.0], abs=1e-4)


def test_what_is_not_plausible_says_why(drive):
    changed, origins = change(drive, {"t1.gap": -8.0})  # from 20 m to 12 m before the ego, of 4.6 m length
    check_limits(drive, changed, origins)
    changed, origins = change(drive, {"t1.gap": -16.0})
    with pytest.raises(InvalidScenario, match="contact: tracks t1 and t0 touch at timestep 0"):
        check_limits(drive, changed, origins)
    changed, origins = change(drive, {"t1.drift": 8.0})  # least jerk: 5.7735 d / T^2 = 5.13 m/s^2 at most
    with pytest.raises(InvalidScenario, match=r"acceleration: wanted at most 4 m/s\^2, found 4\.\d+ in track t1"):
        check_limits(drive, changed, origins, acceleration=4.0)
    check_limits(drive, changed, origins)
    with pytest.raises(InvalidScenario, match="jerk: wanted at most 5"):
        check_limits(drive, changed, origins, jerk=5.0)
