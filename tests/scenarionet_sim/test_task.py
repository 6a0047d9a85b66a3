"""The paper's formulas, computed by hand."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest

from scenarionet_sim.task import MULTI_AGENT, SINGLE_AGENT, TERMS, Contact, Status, Verdict, is_terminated, judge

STEP = {
    "arc": 11.0, "arc_before": 10.0, "offset": 0.5, "length": 100.0, "speed": 4.0, "steering": 0.0,
    "contact": Contact.NOTHING, "steps": 5, "recorded": 90,
}  # fmt: skip
TYPES = {"contact": np.uint8, "steps": np.int64, "recorded": np.int64}


def judged(task=SINGLE_AGENT, **changes):
    """Verdict about one agent at an ordinary step with some of its numbers changed."""
    reward, ending = task
    numbers = [np.array([value], TYPES.get(name, np.float64)) for name, value in (STEP | changes).items()]
    verdict = Verdict.of(1)
    judge(*numbers, reward.numbers, ending.numbers, verdict.terms, verdict.status, verdict.completion)
    return dict(zip(TERMS, verdict.terms[0], strict=True)), Status(verdict.status[0]), verdict.completion[0]


def test_displacement_counts_twice():
    """R_disp = d_t - d_(t-1), c1 = 2; also backwards."""
    assert judged()[0] == {"displacement": 2.0, "smoothness": 0.0, "collision": 0.0, "terminal": 0.0}
    assert judged(arc=9.5)[0]["displacement"] == -1.0


@pytest.mark.parametrize(
    ("speed", "steering", "smoothness"),
    [
        (4.0, 0.25, 0.0),  # 1/4 - 1/4
        (4.0, 0.5, -0.25),
        (4.0, -0.5, -0.25),  # |a[0]|
        (10.0, 1.0, -0.9),
        (1.0, 1.0, 0.0),  # min(0, ...)
        (0.5, 1.0, 0.0),
        (0.0999, 1.0, 0.0),  # 0 below 0.1 m/s
        (0.0, 1.0, 0.0),  # no division by zero
    ],
)
def test_smoothness(speed, steering, smoothness):
    """P_smooth = min(0, 1/v_t - |a[0]|)."""
    assert judged(speed=speed, steering=steering)[0]["smoothness"] == pytest.approx(smoothness, abs=1e-15)


@pytest.mark.parametrize(("contact", "single", "multi"), [(0, 0.0, 0.0), (1, -0.5, -1.0), (2, -2.0, -1.0)])
def test_collision_does_not_end_an_episode(contact, single, multi):
    terms, status, _ = judged(contact=contact)
    assert (terms["collision"], status) == (single, Status.DRIVING)
    terms, status, _ = judged(MULTI_AGENT, contact=contact)
    assert (terms["collision"], status) == (multi, Status.DRIVING)


@pytest.mark.parametrize(
    ("changes", "status", "single", "multi"),
    [
        ({"arc": 95.1, "arc_before": 94.0}, Status.ARRIVED, 10.0, 10.0),
        ({"offset": 2.51}, Status.OFF_ROUTE, -5.0, None),
        ({"offset": 10.01}, Status.OFF_ROUTE, -5.0, -1.0),
        ({"arc": 100.0, "offset": 11.0}, Status.OFF_ROUTE, -5.0, -1.0),
        ({"steps": 140}, Status.TIMED_OUT, 0.0, 0.0),
    ],
)
def test_the_last_step(changes, status, single, multi):
    """R_term by how the episode ended, and R_disp = 0."""
    terms, found, _ = judged(**changes)
    assert (found, terms["terminal"], terms["displacement"]) == (status, single, 0.0)
    terms, found, _ = judged(MULTI_AGENT, **changes)
    if multi is None:  # 2.5 m do not matter there
        assert (found, terms["terminal"], terms["displacement"]) == (Status.DRIVING, 0.0, 1.0)
    else:
        assert (found, terms["terminal"], terms["displacement"]) == (status, multi, 0.0)


def test_limits_themselves_are_inside():
    assert judged(offset=2.5)[1] is Status.DRIVING
    assert judged(arc=95.0)[1] is Status.DRIVING
    assert judged(steps=139)[1] is Status.DRIVING
    assert judged(MULTI_AGENT, offset=10.0)[1] is Status.DRIVING


def test_multi_agent_weighs_displacement_once_and_smoothness_not():
    terms = judged(MULTI_AGENT, steering=1.0, speed=10.0)[0]
    assert terms == {"displacement": 1.0, "smoothness": 0.0, "collision": 0.0, "terminal": 0.0}


def test_completion_is_a_share():
    assert judged(arc=25.0)[2] == 0.25
    assert judged(arc=-3.0)[2] == 0.0
    assert judged(arc=120.0)[2] == 1.0


@pytest.mark.parametrize("length", [0.0, 1.99])
def test_a_route_under_two_metres_counts_as_reached(length):
    assert judged(length=length, arc=0.0)[1:] == (Status.ARRIVED, 1.0)


def test_agents_are_judged_each_by_itself():
    rng = np.random.default_rng(0)
    count = 40
    columns = {
        "arc": rng.uniform(-5, 105, count), "arc_before": rng.uniform(0, 100, count),
        "offset": rng.uniform(0, 4, count),
        "length": rng.choice([1.0, 50.0, 100.0], count), "speed": rng.uniform(0, 20, count),
        "steering": rng.uniform(-1, 1, count), "contact": rng.integers(0, 3, count).astype(np.uint8),
        "steps": rng.integers(1, 150, count), "recorded": np.full(count, 90),
    }  # fmt: skip
    verdict = Verdict.of(count)
    reward, ending = SINGLE_AGENT
    judge(*columns.values(), reward.numbers, ending.numbers, verdict.terms, verdict.status, verdict.completion)
    for agent in range(count):
        terms, status, completion = judged(**{name: values[agent] for name, values in columns.items()})
        assert list(terms.values()) == verdict.terms[agent].tolist()
        assert (status, completion) == (verdict.status[agent], verdict.completion[agent])
    assert set(verdict.status.tolist()) == {0, 1, 2, 3}
    assert is_terminated(verdict.status).tolist() == [code in (1, 2) for code in verdict.status]


def test_weights_are_a_specification():
    reward, _ = SINGLE_AGENT
    assert pickle.loads(pickle.dumps(reward)) == reward
    softer = replace(reward, road_user=-1.0)
    assert judged((softer, SINGLE_AGENT[1]), contact=2)[0]["collision"] == -1.0
