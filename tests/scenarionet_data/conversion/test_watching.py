"""Watching a growing raw folder: new files are converted once they are no longer being written."""

from __future__ import annotations

import os
from functools import partial

import pytest

from scenarionet_data import Lake, convert
from scenarionet_data.conversion import InputSelection, watch
from scenarionet_data.errors import BadParameter, DuplicateScenario
from tests.fixtures.made import BUCKETED, NAME, MadeOptions, write_raw


class EndOfWatch(Exception):
    """Raised by the test to end the watch."""


def watch_reports(raw, lake, *between, name=NAME, **how):
    """Reports of a watch; ``between`` runs while it waits."""
    events = iter(between)
    waited = []

    def wait(seconds):
        waited.append(seconds)
        event = next(events, None)
        if event is None:
            raise EndOfWatch
        event()

    found = []
    converting = partial(convert, name, str(raw), lake, options=MadeOptions(num_objects=2))
    with pytest.raises(EndOfWatch):
        for report in watch(converting, wait=wait, **how):
            found.append((len(waited), report.converted, [shard for shard, _ in report.failed]))
    assert set(waited) == {how.get("every", 30.0)}
    return found


def nothing():
    pass


def test_new_files_are_converted_once_unchanged(tmp_path):
    raw = tmp_path / "raw"
    found = watch_reports(
        raw, tmp_path / "lake", lambda: write_raw(raw, {"a": [1, 2]}), nothing, lambda: write_raw(raw, {"b": [3]}),
        nothing, nothing, every=5.0,
    )  # fmt: skip
    assert found == [(2, 2, []), (4, 1, [])]
    assert len(Lake(tmp_path / "lake")) == 3


def test_files_being_written_wait(tmp_path):
    raw = write_raw(tmp_path / "raw", {"a": [1]})
    found = watch_reports(
        raw, tmp_path / "lake", lambda: write_raw(raw, {"a": [1, 2]}), lambda: write_raw(raw, {"a": [1, 2, 3]}), nothing
    )
    assert found == [(3, 3, [])]


def test_files_written_in_the_middle_wait(tmp_path):
    """A fingerprint samples only the two ends of a large file; its modification time reveals other changes."""
    raw = write_raw(tmp_path / "raw", {"a": [1]})
    found = watch_reports(raw, tmp_path / "lake", lambda: os.utime(raw / "a.made", (1, 1)), nothing)
    assert found == [(2, 1, [])]


def test_failed_shard_is_retried_after_a_change(tmp_path):
    raw = write_raw(tmp_path / "raw", {"a": ["1 corrupt"], "b": [2]})
    found = watch_reports(
        raw, tmp_path / "lake", nothing, nothing, nothing, lambda: write_raw(raw, {"a": [1]}), nothing
    )
    assert found == [(1, 1, ["a"]), (5, 1, [])]


def test_growing_bucket_gets_another_shard(tmp_path):
    raw = write_raw(tmp_path / "raw", {f"s{k}": [k] for k in range(3)})
    more = {f"s{k}": [k] for k in range(3, 8)}
    found = watch_reports(
        raw, tmp_path / "lake", nothing, lambda: write_raw(raw, more), nothing, nothing, name=BUCKETED
    )
    assert found == [(1, 3, []), (3, 5, [])]


def test_converted_files_must_not_change(tmp_path):
    raw = write_raw(tmp_path / "raw", {"a": [1]})
    changes = iter([nothing, lambda: write_raw(raw, {"a": [2]}), nothing])
    with pytest.raises(DuplicateScenario, match="pass replace=True"):
        list(watch(partial(convert, NAME, str(raw), tmp_path / "lake"), wait=lambda _: next(changes)()))


def test_selection_applies_to_new_files(tmp_path):
    raw = write_raw(tmp_path / "raw", {"a1": [1], "b1": [2]})
    wanted = InputSelection({"name": "a*"})
    found = watch_reports(
        raw, tmp_path / "lake", nothing, lambda: write_raw(raw, {"a2": [3]}), nothing, selection=wanted
    )
    assert found == [(1, 1, []), (3, 1, [])]
    with pytest.raises(BadParameter, match="unknown property 'town'"):
        next(watch(partial(convert, NAME, str(raw), tmp_path / "lake"), selection=InputSelection({"town": "x"})))
