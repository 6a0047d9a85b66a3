"""compact and vacuum killed at every step: the lake stays intact, and the same command finishes the work."""

from __future__ import annotations

import shutil
import signal
import subprocess
import sys

import pytest

from scenarionet_data import Lake
from scenarionet_data.maintenance import compact, fsck, vacuum
from scenarionet_data.storage.files.local import LocalLakeFiles
from scenarionet_data.storage.snapshots import snapshot as snapshots
from tests.fixtures.made import write_raw
from tests.fixtures.waiting import HANGS_AFTER
from tests.scenarionet_data.maintenance.conftest import age, check_whole, content, convert_to

STEPS = ("publish", "publish_new", "remove", "remove_unchanged", "renew")
"""What changes a lake."""


class Killed(BaseException):
    """Raised in place of a kill; derived from BaseException, so that no handler catches it."""


@pytest.fixture
def lake(tmp_path):
    """Two shards ready to be compacted, or already compacted and ready to be vacuumed."""
    root = convert_to(write_raw(tmp_path / "raw", {"a": [1], "b": [2]}), tmp_path / "lake")
    Lake(root).filter(name="all")
    return root


def stop_at(monkeypatch, number):
    """Raise after the step with the given number."""
    count = [0]

    def stopping(step):
        def changed(*words):
            count[0] += 1
            is_now = count[0] == number
            done = step(*words)
            if is_now:
                raise Killed
            return done

        return changed

    for name in STEPS:
        monkeypatch.setattr(LocalLakeFiles, name, stopping(getattr(LocalLakeFiles, name)))


def holds_the_same(root, before):
    assert content(Lake(root)) == before


def run_until_it_ends(work, root, check=holds_the_same):
    """Run on copies of a lake, each stopped one step later, until a run completes; return the number of runs.

    Each copy must be intact when stopped, and satisfy ``check`` once the work has been repeated.
    """
    before = content(Lake(root))
    for number in range(1, 100):
        copy = root.parent / "copy"
        shutil.rmtree(copy, ignore_errors=True)
        shutil.copytree(root, copy, copy_function=shutil.copy2)
        with pytest.MonkeyPatch.context() as patch:
            stop_at(patch, number)
            try:
                work(copy)
            except Killed:
                ended = False
            else:
                ended = True
        assert fsck(copy, is_deep=True).problems == ()
        work(copy)
        check(copy, before)
        if ended:
            check_whole(copy)
            return number - 1
    raise AssertionError("it never ends")


@pytest.mark.long
def test_compact_killed_at_every_step(lake):
    def work(root):
        compact(root, "analytics")
        assert len(Lake(root).paths("tracks")) == 1

    assert run_until_it_ends(work, lake) >= 7


@pytest.mark.long
def test_vacuum_killed_at_every_step(lake):
    Lake(lake).drop("all")
    compact(lake, "analytics")

    def work(root):
        vacuum(root, keep_last=1)
        assert snapshots.numbers(LocalLakeFiles(root)) == [2]

    assert run_until_it_ends(work, lake) >= 10


def test_leftovers_of_killed_vacuum_are_removed_after_a_day(lake, monkeypatch):
    Lake(lake).drop("all")
    compact(lake, "analytics")
    with pytest.MonkeyPatch.context() as patch:
        stop_at(patch, 3)
        with pytest.raises(Killed):
            vacuum(lake, keep_last=1)
    (note,) = fsck(lake).notes
    assert note.num_files == 8
    assert vacuum(lake, keep_last=1).files == ()
    age(lake, 1.1)
    assert len(vacuum(lake, keep_last=1).files) == 8
    assert fsck(lake).notes == ()


@pytest.mark.long
def test_replacing_in_compacted_lake_killed_at_every_step(lake):
    compact(lake, "analytics")
    raw = lake.parent / "raw"
    write_raw(raw, {"b": [2, 22]})

    def work(root):
        convert_to(raw, root, replace=True)

    def check(root, before):
        found = content(Lake(root))
        assert found.items() >= before.items()
        assert len(found) == 3
        check_whole(root)

    assert run_until_it_ends(work, lake, check) >= 8


# --- real processes -------------------------------------------------------------------------------------

KILL = """
import os, signal, sys
from scenarionet_data.maintenance import compact, vacuum
from scenarionet_data.storage.write import layouts
from scenarionet_data.storage.files.local import LocalLakeFiles
layouts.LAYOUTS["analytics"] = layouts.Layout("analytics", 3, 8)
what, root, number, steps = sys.argv[1], sys.argv[2], int(sys.argv[3]), sys.argv[4].split()
count = 0
def killing(step):
    def changed(*words):
        global count
        count += 1
        if count == number:
            os.kill(os.getpid(), signal.SIGKILL)
        return step(*words)
    return changed
for name in steps:
    setattr(LocalLakeFiles, name, killing(getattr(LocalLakeFiles, name)))
compact(root, "analytics") if what == "compact" else vacuum(root, keep_last=1)
"""


@pytest.mark.long
@pytest.mark.parametrize("what", ["compact", "vacuum"])
def test_sigkill_at_every_step(lake, what):
    if what == "vacuum":
        Lake(lake).drop("all")
        compact(lake, "analytics")
    before = content(Lake(lake))
    for number in range(1, 100):
        copy = lake.parent / "copy"
        shutil.rmtree(copy, ignore_errors=True)
        shutil.copytree(lake, copy, copy_function=shutil.copy2)
        words = [sys.executable, "-c", KILL, what, str(copy), str(number), " ".join(STEPS)]
        code = subprocess.run(words, check=False, timeout=HANGS_AFTER).returncode
        assert code in (0, -signal.SIGKILL)
        assert fsck(copy, is_deep=True).problems == ()
        compact(copy, "analytics") if what == "compact" else vacuum(copy, keep_last=1)
        assert content(Lake(copy)) == before
        check_whole(copy)
        if code == 0:
            break
    assert number > 7
