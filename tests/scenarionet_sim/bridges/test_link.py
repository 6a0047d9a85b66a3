"""The core between simulation and stacks, with a stack that is a thread of this process."""

from __future__ import annotations

import math
import queue
import threading
import time

import numpy as np
import pytest

from scenarionet_data import Lake
from scenarionet_data.errors import SourceError
from scenarionet_sim.bridges import stacks
from scenarionet_sim.bridges.commands import Push, Steer, Twist
from scenarionet_sim.bridges.commands import drive as drive_by
from scenarionet_sim.bridges.link import NS, Link
from scenarionet_sim.evaluation.evaluation import evaluate
from scenarionet_sim.planners.base import Trajectory
from tests.fixtures.drives import make_drive
from tests.fixtures.lakes import write_lake

LIMIT = 0.6
SCENARIOS = [make_drive(f"d{k}", speed=8.0, num_steps=11) for k in range(4)]


class InMemory:
    """A transport within this process: a thread gets moments and answers as ``answer`` says.

    Args:
        answer: Yields stamp [ns] and command for stamp [ns], speed [m/s] and whether a scenario begins; None: it dies.
    """

    where = "memory"

    def __init__(self, answer):
        self.answer, self.moments, self.answers = answer, queue.Queue(), queue.Queue()
        self.stamps, self.firsts, self.preparing = [], [], 0
        self.thread = threading.Thread(target=self.work, daemon=True)
        self.thread.start()

    def work(self):
        while (told := self.moments.get()) is not None:
            for answer in self.answer(*told):
                if answer is None:
                    return
                self.answers.put(answer)

    def begin(self, moment, until):
        return moment.stamp + self.preparing

    def send(self, moment):
        self.stamps.append(moment.stamp)
        self.firsts.append(moment.is_first)
        self.moments.put((moment.stamp, moment.view.ego.speed, moment.is_first))

    def take(self, until):
        try:
            found = self.answers.get(timeout=max(until - time.monotonic(), 1e-6))
        except queue.Empty:
            return None
        if isinstance(found, Exception):
            raise found
        return found

    def close(self):
        self.moments.put(None)


def obedient(stamp, speed, is_first):
    yield stamp, Steer(0.0, 8.0)


@pytest.fixture(scope="module")
def lake(tmp_path_factory):
    root = tmp_path_factory.mktemp("bridges") / "lake"
    write_lake(root, SCENARIOS)
    return Lake(root)


@pytest.fixture
def drive(lake, monkeypatch):
    """Drive all scenarios with a stack; return its link and transport, the report, and the seconds that it took."""

    def run(answer, name, options=""):
        transport = InMemory(answer)
        monkeypatch.setitem(stacks.TRANSPORTS, "ros2:dds", lambda _: transport)
        stacks.link.cache_clear()
        link = stacks.link(stacks.Stack.parse("ros2:dds" + options))
        link.limit = LIMIT
        started = time.monotonic()
        report = evaluate(lake, policy="ros2:dds" + options, name=name)
        taken = time.monotonic() - started
        transport.close()
        stacks.link.cache_clear()
        return link, transport, report, taken

    return run


def test_one_clock_rises_over_all_scenarios(drive, lake):
    _, transport, report, _ = drive(obedient, "clock")
    assert not report.broken
    steps = np.diff(transport.stamps)
    np.testing.assert_array_equal(steps, np.full(len(steps), round(0.1 * NS)))
    assert sum(transport.firsts) == len(SCENARIOS)
    assert all(Lake(lake.root).sql("SELECT success FROM results WHERE run = 'clock'")["success"].to_list())


def test_a_dead_stack_costs_its_limit_once(drive):
    def dies(stamp, speed, is_first):
        yield (stamp, Steer(0.0, 8.0)) if stamp < 0.5 * NS else None

    _, _, report, taken = drive(dies, "dies")
    assert len(report.broken) == len(SCENARIOS)
    first, *later = [reason for _, reason in report.broken]
    assert "did not answer the moment 0.5 s within 0.6 s over memory; is it running?" in first
    assert all("within 0.2 s" in reason and "nor any since 0.5 s" in reason for reason in later)
    assert taken < LIMIT + 3 * 0.2 + 2.0


def test_a_stack_that_comes_back_drives_on(drive):
    silent = []

    def pauses(stamp, speed, is_first):
        silent.extend([stamp] if is_first else [])
        if len(set(silent)) != 2:  # the second scenario gets no answer
            yield stamp, Steer(0.0, 8.0)

    _, _, report, _ = drive(pauses, "pauses")
    assert [each for each, _ in report.broken] == [SCENARIOS[1].id]


def test_a_late_answer_shows_that_a_stack_lives(lake):
    view = _view()

    def slow(stamp, speed, is_first):
        time.sleep(0.0 if stamp < 0.15 * NS else 0.35)
        yield stamp, Steer(0.0, 8.0)

    transport = InMemory(slow)
    link = Link(transport, limit=0.3)
    link.ask(view, {}, is_first=True)
    with pytest.raises(SourceError, match=r"0\.2 s within 0\.3 s"):
        link.ask(view, {}, is_first=False)
    link.limit = 2.0
    link.ask(view, {}, is_first=True)  # takes longer than what a dead stack gets
    transport.close()


@pytest.mark.parametrize(
    ("answer", "reason"),
    [
        (lambda stamp: [(stamp, Steer(0.0, math.nan))], "expected finite numbers"),
        (lambda stamp: [(stamp, Steer(math.inf, 1.0))], "expected finite numbers"),
        (lambda stamp: [(stamp, Twist(2.0, math.nan))], "expected finite numbers"),
        (lambda stamp: [(1, Steer(0.0, 8.0))], "messages had other stamps"),
        (lambda stamp: [SourceError("7 bytes are no message")], "7 bytes are no message"),
    ],
)
def test_a_wrong_answer_is_a_sentence_and_the_run_goes_on(drive, request, answer, reason):
    _, _, report, _ = drive(lambda stamp, *_: answer(stamp), f"wrong-{request.node.callspec.indices['answer']}")
    assert len(report.broken) == len(SCENARIOS)
    assert all(reason in error for _, error in report.broken), report.broken


def test_a_flood_of_old_answers_hides_no_new_one(drive):
    def flood(stamp, speed, is_first):
        yield from [(1, Steer(0.0, 0.0))] * 3000
        yield stamp, Steer(0.0, 8.0)

    assert not drive(flood, "flood")[2].broken


@pytest.mark.integration
def test_real_time_keeps_to_the_wall_clock_and_holds_commands(drive, lake):
    count = []

    def every_third(stamp, speed, is_first):
        count.append(stamp)
        if is_first or len(count) % 3 == 0:
            yield stamp, Steer(0.0, 8.0)

    _, _, report, taken = drive(every_third, "real", "+realtime")
    assert not report.broken
    wanted = sum(0.1 * (len(each.timestamps) - 2) for each in SCENARIOS)
    assert wanted * 0.95 < taken < wanted + 3.0
    assert all(Lake(lake.root).sql("SELECT success FROM results WHERE run = 'real'")["success"].to_list())


def test_a_stack_that_stops_in_real_time_is_a_sentence(drive):
    def stops(stamp, speed, is_first):
        if stamp < 0.25 * NS:
            yield stamp, Steer(0.0, 8.0)

    _, _, report, taken = drive(stops, "stops", "+realtime")
    assert "sent no command for" in report.broken[0][1]
    assert "is it running?" in report.broken[1][1]
    assert taken < 5.0


def test_a_held_plan_goes_on_where_it_is():
    view = _view()
    poses = np.column_stack([np.arange(1.0, 6.0), np.zeros((5, 2))])
    answers = [(round(0.1 * NS), Trajectory.every(0.1, poses))]

    def once(stamp, speed, is_first):
        yield from answers
        answers.clear()

    transport = InMemory(once)
    link = Link(transport, limit=LIMIT, is_realtime=True)
    first, second = (link.ask(view, {}, is_first=is_first) for is_first in (True, False))
    np.testing.assert_allclose(first.times, [0.1, 0.2, 0.3, 0.4, 0.5])
    np.testing.assert_allclose(second.times, [0.1, 0.2, 0.3, 0.4])
    np.testing.assert_array_equal(second.poses, poses[1:])
    transport.close()


def _view():
    from scenarionet_sim.planners.view import View
    from scenarionet_sim.policies.replay import Replay
    from scenarionet_sim.simulation.simulation import Simulation
    from scenarionet_sim.worlds.world import World

    world = World.from_scenario(SCENARIOS[0])
    simulation = Simulation([world], (Replay(),))
    return View(world, simulation.state, 0, world.ego)


def test_a_stack_that_has_got_ready_is_waited_for_again():
    """The clock runs while it gets ready, and the first moment has the time after that."""

    def slow(stamp, speed, is_first):
        time.sleep(0.35)
        yield stamp, Push(0.0, 2.0)

    transport, view = InMemory(slow), _view()
    link = Link(transport, limit=0.1)
    with pytest.raises(SourceError, match="did not answer"):
        link.ask(view, {}, is_first=True)
    link.limit, transport.preparing = 2.0, NS
    assert link.ask(view, {}, is_first=True) == [0.0, 0.5]  # longer than what a dead stack gets; 2 of 4 m/s²
    assert transport.stamps[-1] == link.stamp == round(1.2 * NS)
    transport.close()


@pytest.mark.parametrize(("acceleration", "throttle"), [(2.0, 0.5), (-4.0, -0.5), (99.0, 1.0)])
def test_an_acceleration_is_a_share_of_what_engine_and_brake_can(acceleration, throttle):
    assert drive_by(Push(math.radians(20.0), acceleration), _view()) == pytest.approx([0.5, throttle])
