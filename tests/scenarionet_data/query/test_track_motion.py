"""Motion from positions, beside loops over single observations."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import pytest

from scenarionet_data.query.track_motion import track_motion


def expected(values, seconds):
    """Rates between the neighbours of each observation, and medians of seven with the ends repeated."""
    last = len(values) - 1
    rates = []
    for i in range(last + 1):
        a, b = max(i - 1, 0), min(i + 1, last)
        rates.append((values[b] - values[a]) / (seconds[b] - seconds[a]) if b > a else 0.0)
    return rates, [float(np.median([values[min(max(i + k, 0), last)] for k in range(-3, 4)])) for i in range(last + 1)]


@pytest.fixture(scope="module")
def moved():
    """Three objects: with a gap and recorded times, without heights or times, and never observed."""
    rng = np.random.default_rng(3)
    xs = [rng.normal(size=n).astype(np.float32) for n in (12, 1, 2)]
    valid = [[True] * 5 + [False] * 2 + [True] * 5, None, [False, False]]
    times = np.cumsum(rng.uniform(0.05, 0.15, 20)).tolist()
    lists = [pa.array([each.tolist() for each in xs], pa.list_(pa.float32()))] * 2
    angles = pa.array([(3 * each).tolist() for each in xs], pa.list_(pa.float32()))
    arguments = (
        *lists, pa.array([xs[0].tolist(), None, None], pa.list_(pa.float32())), angles,
        pa.array(valid, pa.list_(pa.bool_())), pa.array([4, 7, 0], pa.int32()),
        pa.array([times, None, None], pa.list_(pa.float64())), pa.array([0.1, 0.5, 0.1]),
    )  # fmt: skip
    return xs[0].astype(np.float64), times, track_motion(*arguments).to_pylist()


def test_of_each_observation(moved):
    x, times, (first, *_) = moved
    seen = [0, 1, 2, 3, 4, 7, 8, 9, 10, 11]
    seconds = [times[4 + i] for i in seen]
    assert first["timestep"] == [4 + i for i in seen] and first["seconds"] == seconds
    rates, smooth = expected(x[seen], seconds)
    accelerations, smooth_rates = expected(rates, seconds)
    assert first["x"] == first["y"] == pytest.approx(smooth) and first["box_x"] == x[seen].tolist()
    assert first["vx"] == pytest.approx(smooth_rates)
    assert first["accel_y"] == pytest.approx(expected(accelerations, seconds)[1])
    assert first["extent"] == pytest.approx(3**0.5 * (max(smooth) - min(smooth)))


def test_turning_over_the_branch_cut_is_the_short_way():
    headings = pa.array([[3.1, -3.1, -3.0]], pa.list_(pa.float32()))
    still, nothing = pa.array([[0.0] * 3], pa.list_(pa.float32())), pa.nulls(1, pa.list_(pa.float64()))
    found = track_motion(
        still, still, still, headings, pa.nulls(1, pa.list_(pa.bool_())), pa.array([0]), nothing, pa.array([0.5])
    )
    assert found[0]["yaw_rate"].as_py() == pytest.approx([(2 * np.pi - 6.2) / 0.5, 2 * np.pi - 6.1, 0.2], abs=1e-6)


def test_single_observations_stand_still_and_unobserved_objects_have_none(moved):
    _, _, (_, second, third) = moved
    assert second["timestep"] == [7] and second["seconds"] == [3.5]
    assert second["vx"] == second["accel_x"] == second["yaw_rate"] == [0.0] and second["extent"] == 0.0
    assert third["timestep"] == third["x"] == [] and third["extent"] is None
