"""Order in which scenarios are drawn."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarionet_data.errors import BadParameter
from scenarionet_sim.scenarios.sampling import Curriculum, CurriculumSampler, Sequential, Shuffled, Weighted


def draws(sampler, count):
    return [sampler.draw() for _ in range(count)]


@given(count=st.integers(1, 30), seed=st.integers(0, 2**32))
def test_every_round_contains_every_scenario_once(count, seed):
    for sampler in (Sequential(count), Shuffled(count)):
        sampler.restart(seed)
        for _ in range(3):
            assert sorted(draws(sampler, count)) == list(range(count))


@pytest.mark.parametrize(
    "sampler",
    [Sequential(9), Shuffled(9), Weighted(np.arange(9)), CurriculumSampler(9, Curriculum(levels=3))],
    ids=type,
)
def test_restart_repeats_the_series(sampler):
    sampler.restart(7)
    first = draws(sampler, 25)
    sampler.restart(7)
    assert draws(sampler, 25) == first
    if not isinstance(sampler, Sequential):
        sampler.restart(8)
        assert draws(sampler, 25) != first


@given(
    counts=st.lists(st.integers(0, 12), max_size=8),
    kind=st.sampled_from([
        lambda: Sequential(5), lambda: Shuffled(5), lambda: Weighted([0.1, 2.0, 0.0, 1.0]),
        lambda: CurriculumSampler(7, Curriculum(levels=2, episodes=3)),
    ]),
)  # fmt: skip
def test_several_draws_at_once_are_those_one_by_one(counts, kind):
    """Also with results between them, and after a state was restored."""
    together, alone, restored = kind(), kind(), kind()
    for sampler in (together, alone):
        sampler.restart(3)
    for count in counts:
        drawn = draws(alone, count)
        restored.restore(json.loads(json.dumps(together.state())))
        assert together.draw_all(count) == drawn == restored.draw_all(count)
        for sampler in (together, alone):
            for scenario in drawn:
                sampler.report(scenario, 1.0)


def test_rounds_differ():
    sampler = Shuffled(50)
    assert draws(sampler, 50) != draws(sampler, 50)


def test_weights_are_frequencies():
    weights = np.array([0.0, 1.0, 3.0, 0.0, 6.0, 0.0])
    counts = np.bincount(draws(Weighted(weights), 20_000), minlength=6) / 20_000
    assert counts == pytest.approx(weights / 10, abs=0.02)
    assert not counts[weights == 0].any()


@pytest.mark.parametrize("weights", [[], [0.0, 0.0], [1.0, -1.0], [1.0, np.nan], [np.inf]])
def test_invalid_weights(weights):
    with pytest.raises(BadParameter, match="weights"):
        Weighted(weights)


def test_level_ends_at_three_quarters():
    """Ten scenarios in levels of 3, 3 and 4; three of three episodes are required, then four."""
    course = CurriculumSampler(10, Curriculum(levels=3, episodes=4))
    assert sorted(draws(course, 3)) == [0, 1, 2]
    for success in (True, True, False, False, True, False, True):  # never 3 of the last 4
        course.report(0, success)
        assert course.level == 0
    course.report(1, True)  # True, False, True, True
    assert course.level == 1
    assert set(draws(course, 30)) == {3, 4, 5}


def test_promotion_needs_a_full_window_on_each_level():
    course = CurriculumSampler(6, Curriculum(levels=3))
    course.report(0, True)
    assert (course.level, course.success_rate) == (0, 1.0)
    course.report(1, True)
    assert (course.level, course.success_rate) == (1, 0.0)


def test_episodes_of_an_earlier_level_do_not_count():
    course = CurriculumSampler(4, Curriculum(levels=2, episodes=1))
    course.report(0, True)
    course.report(0, False)
    course.report(1, False)
    assert (course.level, course.success_rate) == (1, 0.0)


def test_last_level_continues():
    course = CurriculumSampler(2, Curriculum(levels=2))
    course.report(0, True)
    for _ in range(5):
        course.report(1, True)
    assert course.level == 1
    assert draws(course, 3) == [1, 1, 1]


@given(count=st.integers(1, 500), levels=st.integers(1, 500))
def test_levels_partition_the_scenarios(count, levels):
    if levels > count:
        with pytest.raises(BadParameter, match=f"{levels} levels of {count} scenarios"):
            CurriculumSampler(count, Curriculum(levels=levels))
        return
    course, seen = CurriculumSampler(count, Curriculum(levels=levels, episodes=1)), []
    for level in range(levels):
        size = count // levels + 1
        seen.append(set(draws(course, size * 2)))
        assert course.level == level
        course.report(next(iter(seen[-1])), True)
    assert sorted(number for part in seen for number in part) == list(range(count))
    assert max(map(len, seen)) - min(map(len, seen)) <= 1


@pytest.mark.parametrize("wrong", [{"success": 0.0}, {"success": 1.1}, {"episodes": 0}, {"levels": 0}])
def test_curriculum_out_of_range(wrong):
    with pytest.raises(BadParameter, match=rf"curriculum|{next(iter(wrong))}=.*expected"):
        CurriculumSampler(10, Curriculum(**({"levels": 2} | wrong)))
