"""As many requests at once as a store's distance asks for, in the order in which they are wanted."""

import threading
import time

import pytest

from scenarionet_data.storage.files import requests as requests_module
from scenarionet_data.storage.files.requests import MOST, Requests


@pytest.mark.parametrize(
    ("seconds", "at_once"), [(None, MOST), (0.0, 2), (0.003, 2), (0.0059, 10), (0.0119, 20), (0.05, MOST), (9.0, MOST)]
)
def test_a_far_store_is_asked_for_more_at_once(seconds, at_once):
    requests, running, most, lock = Requests(lambda: seconds), 0, 0, threading.Lock()

    def ask():
        nonlocal running, most
        with lock:
            running += 1
            most = max(most, running)
        time.sleep(0.003)
        with lock:
            running -= 1

    for answer in [requests.start(ask) for _ in range(100)]:
        answer.result()
    assert requests.at_once == at_once
    assert most <= at_once


def test_what_is_asked_first_is_done_first(monkeypatch):
    monkeypatch.setattr(requests_module, "_FEWEST", 1)
    done: list[int] = []
    requests = Requests(lambda: 0.0)
    for answer in [requests.start(done.append, number) for number in range(200)]:
        answer.result()
    assert done == list(range(200))


def test_an_error_reaches_whoever_waits_and_the_next_goes_on():
    requests = Requests(lambda: 0.0)
    bad, good = requests.start(int, "x"), requests.start(int, "3")
    with pytest.raises(ValueError, match="invalid literal"):
        bad.result()
    assert good.result() == 3
    assert requests.start(int, "4").result() == 4


def test_what_nobody_wants_any_more_is_not_asked_for():
    requests, gate, done = Requests(lambda: 0.0), threading.Event(), []
    busy = [requests.start(gate.wait) for _ in range(2)]
    dropped, kept = requests.start(done.append, 1), requests.start(done.append, 2)
    assert dropped.cancel()
    gate.set()
    kept.result()
    assert [answer.result() for answer in busy] == [True, True]
    assert done == [2]


def test_many_side_by_side_keep_their_order():
    assert Requests(lambda: None).side_by_side(str, range(100)) == [str(number) for number in range(100)]
    assert Requests(lambda: None).side_by_side(str, [7]) == ["7"]
