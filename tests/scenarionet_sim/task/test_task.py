"""The paper's formulas, and the careful task's, against hand-computed values."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest

from scenarionet_data.compiled.decorators import kernel
from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_sim.arrays.log import ARC, VX, VY
from scenarionet_sim.arrays.structures import NUM_OBJECTS, NUM_PLACES, NUM_STEPS, OBJECTS, StateArrays
from scenarionet_sim.task.scoring_kernels import COMPLETION, NUM_TOTALS, TERMS, StepResult, score
from scenarionet_sim.task.task import CAREFUL, MULTI_AGENT, SINGLE_AGENT, Status, task_parameters
from tests.fixtures.recorded import recorded

VEHICLE, PERSON, CYCLIST, CONE, BARRIER = (
    1 << kind
    for kind in (
        ObjectType.VEHICLE, ObjectType.PEDESTRIAN, ObjectType.CYCLIST, ObjectType.TRAFFIC_CONE,
        ObjectType.TRAFFIC_BARRIER,
    )
)  # fmt: skip
STEP = {
    "arc": 11.0, "arc_before": 10.0, "lateral": 0.5, "length": 100.0, "speed": 4.0, "steering": 0.0, "hits": 0,
    "timestep": 5, "num_steps": 90, "top_speed": 30.0, "speed_before": np.nan,
}  # fmt: skip


@kernel(allocates=False)
def score_agents(steering, untouched, hits, now, before, worlds, task, totals, result):
    for a in range(len(steering)):
        touched = untouched[a], untouched[a], hits[a]
        routes = now.route[a, 0], before[a, 0]
        score(a, a, 0, steering[a], touched, routes, now, worlds, task, totals, result)


def scored(task=SINGLE_AGENT, **changes):
    """Score agents after an ordinary step with some values replaced; a single agent unless they are arrays."""
    numbers = {name: np.atleast_1d(value) for name, value in (STEP | changes).items()}
    count = max(map(len, numbers.values()))
    step = {name: np.broadcast_to(values, count) for name, values in numbers.items()}
    motion, route, before = np.zeros((count, 1, 7)), np.zeros((count, 1, 2)), np.zeros((count, 1, 2))
    route[:, 0, 0], route[:, 0, 1], before[:, 0, 0] = step["arc"], step["lateral"], step["arc_before"]
    path, log = np.zeros((count, 2, 5), np.float32), np.zeros((200, 8), np.float32)
    path[:, 1, ARC] = step["length"]
    place = np.zeros((count, NUM_PLACES), np.int64)
    place[:, NUM_OBJECTS], place[:, NUM_STEPS], place[:, OBJECTS] = 1, step["num_steps"], np.arange(count)
    offsets = 2 * np.arange(count + 1)  # the end of a path is the beginning of the next one
    worlds = recorded(
        place=place, log=log.reshape(-1, 8), path=path.reshape(-1, 5), path_offsets=offsets, top_speed=step["top_speed"]
    )
    present, timestep = np.ones((count, 1), np.bool_), np.array(step["timestep"], np.int32)
    now = StateArrays(motion, route, present, np.ones((count, 1, 3)), np.ones((count, 1), np.uint8), timestep)
    nothing = np.zeros((count, 1), np.bool_)
    result, totals = StepResult.of(count), np.zeros((count, 1, NUM_TOTALS))
    steering, hits = np.array(step["steering"], np.float64), np.array(step["hits"], np.uint32)
    for speed in (step["speed_before"], step["speed"]):
        if not np.isnan(speed).any():
            motion[:, 0, VX], motion[:, 0, VY] = 0.6 * speed, -0.8 * speed
            score_agents(steering, nothing, hits, now, before, worlds, task_parameters(*task, 0.5), totals, result)
    terms, completion = result.numbers[:4].T, result.numbers[COMPLETION]
    np.testing.assert_array_equal(result.rewards, sum(result.numbers[:4]))
    ends = [result.status == code for code in (Status.ARRIVED, Status.OFF_ROUTE, Status.TIMED_OUT)]
    np.testing.assert_array_equal(result.flags, [ends[0] | ends[1], ends[2], *ends])
    if count > 1:
        return terms, result.status, completion
    return dict(zip(TERMS, terms[0].tolist(), strict=True)), Status(result.status[0]), completion[0]


def test_displacement_counts_twice():
    """R_disp = d_t - d_(t-1), c1 = 2; also backwards."""
    assert scored()[0] == {"displacement": 2.0, "smoothness": 0.0, "collision": 0.0, "terminal": 0.0}
    assert scored(arc=9.5)[0]["displacement"] == -1.0


@pytest.mark.parametrize(
    ("speed", "steering", "smoothness"),
    [
        (4.0, 0.25, 0.0),  # 1/4 - 1/4
        (4.0, 0.5, -0.25),
        (4.0, -0.5, -0.25),  # |a[0]|
        (10.0, 1.0, -0.9),
        (1.0, 1.0, 0.0),  # min(0, ...)
        (0.5, 1.0, 0.0),
        (0.099, 20.0, 0.0),  # 0 below 0.1 m/s
        (0.0, 1.0, 0.0),  # no division by zero
    ],
)
def test_smoothness(speed, steering, smoothness):
    """P_smooth = min(0, 1/v_t - |a[0]|)."""
    assert scored(speed=speed, steering=steering)[0]["smoothness"] == pytest.approx(smoothness, abs=1e-15)


@pytest.mark.parametrize(
    ("hits", "single", "multi"),
    [
        (0, 0.0, 0.0),
        (VEHICLE, -2.0, -1.0),
        (PERSON, -2.0, -1.0),
        (CYCLIST, -2.0, -1.0),
        (CONE, -0.5, -1.0),
        (BARRIER, -0.5, -1.0),
        (CONE | PERSON | BARRIER, -2.0, -1.0),  # the largest, once
    ],
)
def test_collision_does_not_end_an_episode(hits, single, multi):
    terms, status, _ = scored(hits=hits)
    assert (terms["collision"], status) == (single, Status.DRIVING)
    terms, status, _ = scored(MULTI_AGENT, hits=hits)
    assert (terms["collision"], status) == (multi, Status.DRIVING)


@pytest.mark.parametrize(
    ("changes", "status", "single", "multi"),
    [
        ({"arc": 95.1, "arc_before": 94.0}, Status.ARRIVED, 10.0, 10.0),
        ({"lateral": 2.51}, Status.OFF_ROUTE, -5.0, None),
        ({"lateral": -10.01}, Status.OFF_ROUTE, -5.0, -1.0),
        ({"arc": 100.0, "lateral": 11.0}, Status.OFF_ROUTE, -5.0, -1.0),
        ({"timestep": 140}, Status.TIMED_OUT, 0.0, 0.0),
    ],
)
def test_last_step(changes, status, single, multi):
    """R_term by how the episode ended, and R_disp = 0."""
    terms, found, _ = scored(**changes)
    assert (found, terms["terminal"], terms["displacement"]) == (status, single, 0.0)
    terms, found, _ = scored(MULTI_AGENT, **changes)
    if multi is None:  # 2.5 m of lateral offset do not matter here
        assert (found, terms["terminal"], terms["displacement"]) == (Status.DRIVING, 0.0, 1.0)
    else:
        assert (found, terms["terminal"], terms["displacement"]) == (status, multi, 0.0)


def test_limits_are_inclusive():
    assert scored(lateral=2.5)[1] is Status.DRIVING
    assert scored(arc=95.0)[1] is Status.DRIVING
    assert scored(timestep=139)[1] is Status.DRIVING
    assert scored(MULTI_AGENT, lateral=10.0)[1] is Status.DRIVING


def test_multi_agent_weighs_displacement_once_and_smoothness_not():
    terms = scored(MULTI_AGENT, steering=1.0, speed=10.0)[0]
    assert terms == {"displacement": 1.0, "smoothness": 0.0, "collision": 0.0, "terminal": 0.0}


def test_completion_is_a_fraction():
    assert scored(arc=25.0)[2] == 0.25
    assert scored(arc=-3.0)[2] == 0.0
    assert scored(arc=120.0)[2] == 1.0


@pytest.mark.parametrize("length", [0.0, 1.99])
def test_route_under_two_metres_counts_as_reached(length):
    assert scored(length=length, arc=0.0)[1:] == (Status.ARRIVED, 1.0)


def test_agents_are_scored_independently():
    rng, count = np.random.default_rng(0), 40
    columns = {
        "arc": rng.uniform(-5, 105, count), "arc_before": rng.uniform(0, 100, count),
        "lateral": rng.uniform(-4, 4, count), "length": rng.choice([1.0, 50.0, 100.0], count),
        "speed": rng.uniform(0, 20, count), "steering": rng.uniform(-1, 1, count),
        "hits": rng.choice([0, CONE, PERSON], count), "timestep": rng.integers(1, 150, count),
    }  # fmt: skip
    all_terms, all_status, all_completion = scored(**columns)
    for agent in range(count):
        terms, status, completion = scored(**{name: values[agent] for name, values in columns.items()})
        assert list(terms.values()) == all_terms[agent].tolist()
        assert (status, completion) == (all_status[agent], all_completion[agent])
    assert set(all_status.tolist()) == {0, 1, 2, 3}


@pytest.mark.parametrize(
    ("changes", "smoothness"),
    [
        ({"speed": 14.5, "top_speed": 12.0}, -2.5),  # 1 for each m/s above
        ({"speed": 12.0, "top_speed": 12.0}, 0.0),
        ({"speed": 8.0, "speed_before": 10.5}, -1.0),  # 5 m/s² in half a second, 2 beyond 3, at 0.5 each
        ({"speed": 10.5, "speed_before": 8.0}, -1.0),
        ({"speed": 8.0, "speed_before": 9.4}, 0.0),
        ({"speed": 8.0, "speed_before": 10.5, "top_speed": 7.0, "steering": 1.0}, -1.0 - 1.0 - 0.875),
    ],
)
def test_the_careful_task_counts_speed_above_the_limit_and_harsh_changes(changes, smoothness):
    assert scored(CAREFUL, **changes)[0]["smoothness"] == pytest.approx(smoothness, abs=1e-12)
    wanted = min(0.0, 1.0 / changes["speed"] - changes.get("steering", 0.0))
    assert scored(**changes)[0]["smoothness"] == pytest.approx(wanted, abs=1e-12)  # the paper's has neither


def test_in_the_careful_task_a_crash_costs_more_than_it_gains():
    """Contact in each step of a drive at 9 m/s costs more than the 0.9 m forward are worth."""
    terms = scored(CAREFUL, hits=VEHICLE, arc=10.9)[0]
    assert terms["displacement"] == pytest.approx(1.8) and terms["collision"] == -20.0
    assert scored(CAREFUL, hits=CONE)[0]["collision"] == -10.0


def test_weights_are_part_of_the_specification():
    reward, _ = SINGLE_AGENT
    assert pickle.loads(pickle.dumps(reward)) == reward
    softer = replace(reward, road_user=-1.0)
    assert scored((softer, SINGLE_AGENT[1]), hits=PERSON)[0]["collision"] == -1.0
