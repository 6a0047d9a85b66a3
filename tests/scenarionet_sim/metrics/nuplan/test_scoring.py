"""Parts of the closed-loop score with hand-computed values."""

from __future__ import annotations

import numpy as np
import pytest

from scenarionet_data.errors import BadParameter
from scenarionet_sim.metrics.nuplan import closed_loop_score, driving_direction, plan_errors, speed_limit_score
from scenarionet_sim.metrics.nuplan.scoring import MULTIPLIERS, WEIGHTS, direction_score, progress_score


def test_closed_loop_score():
    perfect = dict.fromkeys([*MULTIPLIERS, *WEIGHTS], 1.0)
    assert closed_loop_score(perfect) == 1.0
    assert closed_loop_score(perfect | {"ego_progress_along_expert_route": 0.5}) == pytest.approx(1 - 2.5 / 16)
    assert closed_loop_score(perfect | {"ego_is_comfortable": 0.0}) == pytest.approx(14 / 16)
    for name in MULTIPLIERS:
        assert closed_loop_score(perfect | {name: 0.0}) == 0.0
    assert closed_loop_score(perfect | {"driving_direction_compliance": 0.5, "ego_is_comfortable": 0.0}) == 7 / 16
    without_limit = {**perfect, "speed_limit_compliance": None, "ego_is_comfortable": 0.0}
    assert closed_loop_score(without_limit) == pytest.approx(10 / 12), "a part that is not decided has no weight"
    with pytest.raises(BadParameter, match="no part 'comfort'; there are no_ego_at_fault_collisions, "):
        closed_loop_score({"comfort": 1.0})


def test_speed_limit():
    time = 0.1 * np.arange(11)
    assert speed_limit_score(np.zeros(11), time) == 1.0
    assert speed_limit_score(np.array([0.0] * 10 + [2.23]), time) == pytest.approx(0.9)
    assert speed_limit_score(np.array([0.0] * 10 + [2.23]), time + 5.0) == pytest.approx(0.9), "from any time on"
    assert speed_limit_score(np.full(11, 5.0), time) == 0.0
    assert speed_limit_score(np.full(1, 5.0), time[:1]) == 1.0


@pytest.mark.parametrize(("step", "score"), [(0.1, 1.0), (-0.1, 1.0), (-0.3, 0.5), (-0.6, 0.0)])
def test_driving_direction(step: float, score: float):
    """Eleven moments count, of one second and the one at its start."""
    found, distance = driving_direction([0.0] + [step] * 30, 0.1)
    assert found == score
    assert distance == pytest.approx(min(0.0, 11 * step))


def test_direction_of_the_last_second_only():
    assert driving_direction([0.0, -5.0, *[0.0] * 20, -3.0], 0.1)[1] == pytest.approx(-5.0)


@pytest.mark.parametrize(("distance", "score"), [(1.9, 1.0), (2.0, 0.5), (5.9, 0.5), (6.0, 0.0)])
def test_direction(distance: float, score: float):
    assert direction_score(distance) == score


@pytest.mark.parametrize(("ratio", "score"), [(0.0, 0.0), (0.199, 0.0), (0.2, 1.0), (1.0, 1.0)])
def test_progress(ratio: float, score: float):
    assert progress_score(ratio) == score


def test_open_loop_score():
    far, turned = np.full((5, 8), 4.0), np.full((5, 8), 0.2)
    found = plan_errors(far, turned)
    assert found.miss_rates.tolist() == [0.0, 0.0, 0.0]
    assert found.open_loop_score == pytest.approx((0.5 + 0.5 + 2 * 0.75 + 2 * 0.75) / 6)
    assert plan_errors(far + 3.0, turned).open_loop_score == 0.0, "all plans miss by more than 6 m within 3 s"
