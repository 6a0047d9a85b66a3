"""Items shared out to threads: each is taken once, whatever the threads do."""

from __future__ import annotations

import multiprocessing
from functools import partial

import numpy as np
import pytest

from scenarionet_data.compiled.decorators import kernel
from scenarionet_sim.threads.sharing import JOIN, LEADER, LEAVE, STAY_OUT, Team, begin, end, keep, kept, ranges_of, take
from scenarionet_sim.threads.team import Threads


@kernel(nogil=True, allocates=False)
def take_all(own, team, arguments):
    """Take items until none is left, and add a number to each that is taken; the result is the last item."""
    if own == LEADER:
        keep(team, arguments)
    turn = begin(team, own, 0)
    while turn:
        number, taken = kept(team, arguments)
        last, item = -1, take(team.ranges, own)
        while item >= 0:
            taken[item] += number
            last, item = max(last, item), take(team.ranges, own)
        turn = end(team, own, turn, last)


@kernel(allocates=False)
def take_one(ranges, own):
    """Take an item."""
    return take(ranges, own)


@pytest.mark.parametrize("total", [1, 7, 100_000])
def test_threads_take_every_item_once(total):
    threads = Threads(3)
    for turn in range(1, 601):  # helpers stay in the kernel, and leave it, between turns
        taken = np.zeros(total if turn < 4 else min(total, 100), np.int64)  # other arguments in every turn
        last = threads.share(lambda own, team, given=(turn, taken): take_all(own, team, given), len(taken))
        assert last == len(taken) - 1
        np.testing.assert_array_equal(taken, turn)
    threads.close()


@pytest.mark.parametrize("total", [1, 7, 1000])
def test_items_that_are_spread_are_taken_once(total):
    threads, taken = Threads(3), np.zeros(total, np.int64)

    def take_some(own, ranges):
        item = take_one(ranges, own)
        while item >= 0:
            taken[item] += 1
            item = take_one(ranges, own)

    threads.spread(take_some, total)
    np.testing.assert_array_equal(taken, 1)
    threads.close()


def test_helpers_that_were_dismissed_or_closed_come_again():
    threads, taken = Threads(2), np.zeros(64, np.int64)
    for stop in (threads.dismiss, threads.dismiss, threads.close, threads.close, lambda: None):
        threads.share(lambda own, team: take_all(own, team, (1, taken)), len(taken))
        stop()
    np.testing.assert_array_equal(taken, 5)
    threads.close()


def test_what_a_helper_raises_is_raised_in_the_next_turn():
    threads = Threads(2)

    def fail(own, team):
        if own != LEADER:
            raise ValueError("no")
        take_all(own, team, (1, np.zeros(64, np.int64)))

    with pytest.raises(ValueError, match="no"):
        for _ in range(10_000):
            threads.share(fail, 64)
    threads.close()


def one_turn(threads):
    threads.share(lambda own, team: take_all(own, team, (1, np.zeros(64, np.int64))), 64)


def stress(turns):
    """Run turns with new arrays each, among them turns that fail, forks, and helpers that end."""
    threads, rng = Threads(2), np.random.default_rng(0)
    forks = multiprocessing.get_context("fork")
    for turn in range(1, turns + 1):
        taken = np.full(64 + turn % 5, turn, np.int64)

        def work(own, team, taken=taken, fails=turn % 997 == 0):
            take_all(own, team, (3, taken))
            if fails and own == LEADER:
                raise ValueError("as it shall")

        if turn % 997 == 0:
            with pytest.raises(ValueError, match="as it shall"):
                threads.share(work, len(taken))
            del taken, work  # helpers may be in the turn still: the team owns its arrays
            np.full(69, -1, np.int64)  # where freed memory would be used again
            continue
        threads.share(work, len(taken))
        if not (taken == turn + 3).all():
            return turn
        if turn % 1501 == 0:
            (threads.dismiss if rng.random() < 0.5 else threads.close)()
        if turn % 50_021 == 0:
            child = forks.Process(target=partial(one_turn, threads))
            child.start()
            child.join(60.0)
            if child.exitcode != 0:
                return turn
    threads.close()
    return None


def test_no_turn_is_wrong_whatever_happens_to_arrays_and_helpers():
    assert stress(20_000) is None


@pytest.mark.long
def test_no_turn_of_a_million_is_wrong():
    assert stress(1_000_000) is None


def test_the_arrays_of_a_turn_that_fails_are_kept_until_the_next_one():
    threads = Threads(2)
    for _ in range(40):  # some turns are run alone
        taken = np.zeros(64, np.int64)

        def work(own, team, taken=taken):
            if own == LEADER:
                raise KeyboardInterrupt
            take_all(own, team, (1, taken))

        with pytest.raises(KeyboardInterrupt):
            threads.share(work, 64)
        kept_by = threads._lent
        assert kept_by is None or kept_by is work
        if kept_by is work:
            break
    assert kept_by is work
    threads.share(lambda own, team: take_all(own, team, (1, np.zeros(64, np.int64))), 64)
    assert threads._lent is None
    threads.close()


def test_a_forked_process_has_threads_of_its_own():
    threads = Threads(2)

    def taken_here():
        taken = np.zeros(64, np.int64)
        threads.share(lambda own, team: take_all(own, team, (1, taken)), len(taken))
        return taken.tolist()

    assert taken_here() == [1] * 64
    context = multiprocessing.get_context("fork")
    queue = context.SimpleQueue()
    process = context.Process(target=lambda: queue.put(taken_here()))
    process.start()
    assert queue.get() == [1] * 64
    process.join()
    threads.close()


def test_a_thread_begins_with_its_own_range_and_takes_what_others_leave():
    ranges = ranges_of(10, 3)
    assert [take_one(ranges, own) for own in (0, 1, 2, 0, 1, 1, 1)] == [0, 3, 6, 1, 4, 5, 7]
    assert [take_one(ranges, 0) for _ in range(4)] == [2, 8, 9, -1]


def test_a_team_reports_its_helpers_and_its_largest_result():
    team = Team.of(10, 2)
    take_all(LEADER, team, (1, np.zeros(10, np.int64)))
    assert (team.is_helped, team.result) == (False, 9)
    team.gate[0, 0] += 1
    assert team.is_helped


def test_helpers_are_awaited_in_turns_that_they_may_join():
    """A helper that has left the kernel joins again while a turn is open, unless it shall stay out."""
    team, seen = Team.of(4, 2), []

    class Watching(Threads):
        def _wait(self):
            seen.append(self._team.awaits_helpers)
            super()._wait()

    threads = Watching(2)
    taken = np.zeros(100, np.int64)
    for turn in range(1, 5):
        threads.share(lambda own, team: take_all(own, team, (1, taken)), len(taken))
        assert threads._team.turn == turn
    assert not any(seen)  # no turn is open between the calls of the leader
    threads.close()
    for order, is_awaited in ((JOIN, True), (STAY_OUT, False), (LEAVE, False)):
        team.order(order)
        assert not team.awaits_helpers
        open_turn(team)
        assert team.awaits_helpers == is_awaited
        close_turn(team)
    np.testing.assert_array_equal(taken, 4)


@kernel(allocates=False)
def open_turn(team):
    """Begin a turn as the leader."""
    begin(team, LEADER, 0)


@kernel(allocates=False)
def close_turn(team):
    """End it."""
    end(team, LEADER, 1, 0)
