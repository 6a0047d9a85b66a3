"""Motion from positions, beside loops over single observations."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import pytest

from scenarionet_data.query.motion_kernels import mark_turns
from scenarionet_data.query.track_motion import track_motion


def expected(values, seconds):
    """Rates between the neighbours of each observation, and medians of seven with the ends repeated."""
    last = len(values) - 1
    rates = []
    for i in range(last + 1):
        a, b = max(i - 1, 0), min(i + 1, last)
        rates.append((values[b] - values[a]) / (seconds[b] - seconds[a]) if b > a else 0.0)
    return rates, [float(np.median([values[min(max(i + k, 0), last)] for k in range(-3, 4)])) for i in range(last + 1)]


def states(*lists):
    """What track_motion is given of each object."""
    columns = [pa.array(each, pa.list_(pa.float32())) for each in lists]
    return pa.chunked_array([pa.StructArray.from_arrays(columns, ["x", "y", "z", "heading", "length", "width"])])


@pytest.fixture(scope="module")
def moved():
    """Three objects: with a gap and recorded times, without heights or times, and never observed."""
    rng = np.random.default_rng(3)
    xs = [rng.normal(size=n).astype(np.float32) for n in (12, 1, 2)]
    valid = [[True] * 5 + [False] * 2 + [True] * 5, None, [False, False]]
    times = np.cumsum(rng.uniform(0.05, 0.15, 20)).tolist()
    walked = [each.tolist() for each in xs]
    angles = [(3 * each).tolist() for each in xs]
    arguments = (
        states(walked, walked, [walked[0], None, None], angles, [[4.5], [4.0], []], [range(12), [2.0], None]),
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
    still, nothing = [[0.0] * 3], pa.nulls(1, pa.list_(pa.float64()))
    found = track_motion(
        states(*[still] * 3, [[3.1, -3.1, -3.0]], still, still),
        pa.nulls(1, pa.list_(pa.bool_())), pa.array([0]), nothing, pa.array([0.5]),
    )  # fmt: skip
    assert found[0]["yaw_rate"].as_py() == pytest.approx([(2 * np.pi - 6.2) / 0.5, 2 * np.pi - 6.1, 0.2], abs=1e-6)


def test_single_observations_stand_still_and_unobserved_objects_have_none(moved):
    _, _, (_, second, third) = moved
    assert second["timestep"] == [7] and second["seconds"] == [3.5]
    assert second["vx"] == second["accel_x"] == second["yaw_rate"] == [0.0] and second["extent"] == 0.0
    assert third["timestep"] == third["x"] == [] and third["extent"] is None


def test_sizes_are_those_of_the_step_or_the_only_one(moved):
    _, _, (first, second, _) = moved
    assert first["length"] == [4.5] * 10 and first["width"] == [0, 1, 2, 3, 4, 7, 8, 9, 10, 11]
    assert second["radius"] == [20**0.5 / 2]


def turns(rates, step):
    """Which sides an object turns to at each step, run by run."""
    found, start = [set() for _ in rates], 0
    step = step if len(rates) > 1 else 0.0  # unknown of one observation
    edges = {0, len(rates) - 1}
    while start < len(rates):
        stop = start + 1
        while stop < len(rates) and rates[start] and np.sign(rates[stop]) == np.sign(rates[start]):
            stop += 1
        run = range(start, min(stop + 1, len(rates)))
        degrees = np.degrees([rates[i] for i in run])
        for side in (1, -1):
            is_cut = any(side * np.degrees(rates[i]) > 5 for i in edges & set(run)) and side * degrees.mean() > 5
            if side * degrees.sum() * step > (15 if is_cut else 45):
                for i in run:
                    found[i].add(side)
        start = stop
    return [(1 in each) + 2 * (-1 in each) for each in found]


def test_turns_are_marked_with_the_step_at_which_they_end():
    rng, seen = np.random.default_rng(8), set()
    for count in (*range(1, 6), *[40] * 40):
        rates = np.repeat(rng.normal(0, 1, count), rng.integers(1, 9, count))[:count] * (rng.random(count) > 0.1)
        sides = np.empty(count, np.uint8)
        mark_turns(np.array([0, count]), 0.2 * np.arange(count), rates, sides)
        assert sides.tolist() == turns(rates, 0.2)
        seen.update(sides.tolist())
    assert seen == {0, 1, 2, 3}
