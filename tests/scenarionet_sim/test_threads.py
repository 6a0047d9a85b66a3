"""Ranges of items in threads: each item once, whatever the threads do."""

from __future__ import annotations

import multiprocessing
import sys
import threading
import time

import numpy as np
import pytest

from scenarionet_sim.threads import Threads


@pytest.fixture
def threads():
    found = Threads(3)
    yield found
    found.close()


def add_one(taken):
    def add(_own, first, end):
        taken[first:end] += 1
        return end - 1

    return add


@pytest.mark.parametrize("total", [0, 1, 7, 1000])
def test_every_item_is_taken_once(total, threads):
    taken = np.zeros(total, np.int64)
    for turn in range(1, 201):
        assert threads.run(add_one(taken), total) == total - 1
        np.testing.assert_array_equal(taken, turn)


def test_a_thread_that_comes_too_late_is_not_waited_for(threads):
    threads.run(add_one(np.zeros(64, np.int64)), 64)  # starts the pool
    can_end = threading.Event()
    blockers = [threads._threads().submit(can_end.wait) for _ in range(2)]
    taken = np.zeros(64, np.int64)
    assert threads.run(add_one(taken), 64) == 63  # would wait for ever
    can_end.set()
    assert all(blocker.result() for blocker in blockers)
    np.testing.assert_array_equal(taken, 1)


@pytest.mark.parametrize("fails_in", ["caller", "other"])
def test_what_any_thread_raises_is_raised(fails_in, threads):
    has_failed = threading.Event()

    def fail(own, _first, _end):
        if (own == 0) == (fails_in == "caller"):
            has_failed.set()
            raise ValueError("no")
        return int(has_failed.wait(60))

    with pytest.raises(ValueError, match="no"):
        threads.run(fail, 64)
    taken = np.zeros(64, np.int64)
    threads.run(add_one(taken), 64)
    np.testing.assert_array_equal(taken, 1)


def test_arguments_are_dropped_after_each_run(threads):
    taken = np.zeros(64, np.int64)
    before = sys.getrefcount(taken)
    for _ in range(20):
        threads.run(add_one(taken), 64)
    time.sleep(0.05)
    assert sys.getrefcount(taken) == before


def test_closed_threads_come_again(threads):
    taken = np.zeros(64, np.int64)
    for _ in range(3):
        threads.run(add_one(taken), 64)
        threads.close()
        threads.close()
    np.testing.assert_array_equal(taken, 3)


def test_a_forked_process_has_threads_of_its_own(threads):
    def taken_here():
        taken = np.zeros(64, np.int64)
        threads.run(add_one(taken), 64)
        return taken.tolist()

    assert taken_here() == [1] * 64
    context = multiprocessing.get_context("fork")
    queue = context.SimpleQueue()
    process = context.Process(target=lambda: queue.put(taken_here()))
    process.start()
    assert queue.get() == [1] * 64
    process.join()
