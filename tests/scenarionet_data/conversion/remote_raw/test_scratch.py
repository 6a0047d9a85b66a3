"""Temporary folders are removed with their process, however it ends."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
from contextlib import closing

import pytest

from scenarionet_data.conversion.remote_raw.scratch import ScratchFolder

HOLD = """
import sys
from scenarionet_data.conversion.remote_raw.scratch import ScratchFolder
scratch = ScratchFolder()
(scratch.path / "deep").mkdir()
(scratch.path / "deep" / "file").write_text("half a do")
print(scratch.path, flush=True)
sys.stdin.readline()
"""


@pytest.fixture(autouse=True)
def temporary(monkeypatch, tmp_path):
    """A private folder for temporary files, for this process and its children."""
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", None)
    return tmp_path


def holder():
    return subprocess.Popen(
        [sys.executable, "-c", HOLD], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=os.environ
    )


def test_leftovers_of_a_killed_process_are_removed_by_the_next(temporary):
    with holder() as process:
        assert process.stdout.readline().startswith(str(temporary))
        process.send_signal(signal.SIGKILL)
    (left,) = temporary.iterdir()
    assert (left / "deep" / "file").is_file()
    with closing(ScratchFolder()) as scratch:
        assert list(temporary.iterdir()) == [scratch.path] != [left]
    assert list(temporary.iterdir()) == []


def test_folder_of_a_running_process_is_kept(temporary):
    with holder() as process:
        held = process.stdout.readline().strip()
        with closing(ScratchFolder()) as scratch, closing(ScratchFolder()) as other:
            assert {str(path) for path in temporary.iterdir()} == {held, str(scratch.path), str(other.path)}
        assert [str(path) for path in temporary.iterdir()] == [held]
        process.stdin.write("\n")
        process.stdin.flush()
    assert process.returncode == 0
    assert list(temporary.iterdir()) == []


def test_forked_process_does_not_remove_it(temporary):
    with closing(ScratchFolder()) as scratch:
        child = os.fork()
        if not child:
            scratch.close()
            os._exit(0)
        assert os.waitpid(child, 0) == (child, 0)
        assert scratch.path.is_dir()
