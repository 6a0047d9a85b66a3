"""``scenarionet convert``: the report, resuming, options, progress, interruption."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import click
import psutil
import pytest

from scenarionet_data import Lake
from tests.fixtures import gate
from tests.fixtures.made import NAME, held_raw, write_raw
from tests.fixtures.waiting import HANGS_AFTER, until
from tests.scenarionet_pipelines.conftest import run

pytestmark = pytest.mark.integration


def test_report(raw, tmp_path):
    result = run("convert", NAME, raw, tmp_path / "lake", "--workers", 1, "--split", "val")
    assert result.exit_code == 1  # one scenario is in quarantine
    lines = dict(line.split(maxsplit=1) for line in result.stdout.splitlines()[:3])
    assert lines["converted"].startswith("9 scenarios in 2 shards, ")
    assert lines["into"] == "made/v1/val"
    assert lines["quarantined"] == "1 scenario"
    assert "1 x InvalidScenario: wanted a positive timestep, found -1.0" in result.stdout
    assert " scenarios/s" in result.stdout
    assert "SELECT * FROM quarantine" in result.stdout.splitlines()[-1]


_IMPORTS = """
import contextlib, sys
from scenarionet_pipelines.cli import main
with contextlib.suppress(SystemExit):
    main()
print(sorted({"pandas", "scipy.linalg"} & sys.modules.keys()))
with contextlib.suppress(ModuleNotFoundError):  # they still work, where they are installed
    import pandas, pyarrow
    assert isinstance(pyarrow.table({"a": [1]}).to_pandas(), pandas.DataFrame)
with contextlib.suppress(ModuleNotFoundError):
    import scipy.linalg.cython_blas
"""


def test_pandas_and_scipy_are_not_imported(tmp_path):
    """They would take a third of the time to convert a log."""
    command = [sys.executable, "-c", _IMPORTS, "convert", "pg", "0:1", str(tmp_path / "lake"), "--quiet"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]", done.stderr


def test_running_again_skips_and_succeeds(raw, lake, ok):
    text = ok("convert", NAME, raw, lake)
    assert "skipped    2 shards already in the lake" in text
    assert text.splitlines()[-1].startswith("Show what the lake contains: scenarionet list")


def test_json_report(raw, tmp_path):
    write_raw(raw, {"c": ["1 corrupt"]})
    result = run("convert", NAME, raw, tmp_path / "lake", "--json", "--quiet", "--workers", 1)
    assert result.exit_code == 1
    assert result.stderr == ""
    report = json.loads(result.stdout)
    assert (report["converted"], report["quarantined"], report["shards"]) == (9, 1, 2)
    assert report["partitions"] == ["made/v1/train"]
    assert report["reasons"][0]["field"] == "dt"
    (share,) = report["workers"].values()
    assert share["counts"] == {"scenarios": 9, "bytes": report["size"], "failed": 1}
    (failed,) = report["failed"]
    assert failed["shard"] == "c"
    assert "corrupt" in failed["reason"]
    assert report["is_clean"] is False
    assert report["next"].startswith("Fix the cause")


def test_failed_shards_are_named(raw, tmp_path):
    write_raw(raw, {"c": ["1 corrupt"]})
    text = run("convert", NAME, raw, tmp_path / "lake", "--workers", 1).stdout
    assert "failed       1 shard\n" in text
    assert "c.made: corrupt; copy it again" in text


def test_dry_run_writes_nothing(raw, lake, tmp_path, ok, as_json):
    text = ok("convert", NAME, raw, tmp_path / "new", "--dry-run")
    assert "would convert  2 shards with 2 raw inputs" in text
    assert "would take     about " in text
    assert not (tmp_path / "new").exists()
    write_raw(raw, {"c": ["21"]})
    found = as_json("convert", NAME, raw, lake, "--dry-run")
    assert found.pop("seconds") > 0
    assert found == {
        "shards": ["made/v1/train/c"],
        "inputs": 1,
        "skipped": 2,
        "replaced": 0,
        "stale": 0,
        "passed_over": [],
    }
    assert Lake(lake).snapshot.number == 1


def test_where_and_files_select_recordings(raw, tmp_path, ok):
    text = ok("convert", NAME, raw, tmp_path / "new", "--dry-run", "--where", "file=a*")
    assert "would convert  1 shard with 1 raw input" in text
    text = ok("convert", NAME, raw, tmp_path / "new", "--dry-run", "--files", "1:")
    assert "would convert  1 shard with 1 raw input" in text
    for words, message in (
        (["--where", "city=pit"], "inputs can be selected by file, name"),
        (["--where", "city"], "expects name=value"),
        (["--files", "5"], "takes START:END"),
    ):
        refused = run("convert", NAME, raw, tmp_path / "new", *words)
        assert refused.exit_code == 2
        assert message in refused.stderr


def test_options_replace_and_limit(raw, lake, ok):
    refused = run("convert", NAME, raw, lake, "-O", "num_objects=7")
    assert refused.exit_code == 1
    assert "--replace" in refused.stderr
    (raw / "b.made").unlink()
    again = run("convert", NAME, raw, lake, "-O", "num_objects=7", "--replace")
    assert again.exit_code == 0
    assert "replaced   1 shard" in again.stdout
    assert Lake(lake).sql("SELECT max(num_objects) AS n FROM metadata")["n"].item() > 5
    limited = ok("convert", NAME, raw, lake, "--version", "v2", "--limit", "2")
    assert "converted  2 scenarios in 1 shard" in limited


@pytest.mark.long
def test_progress_goes_to_standard_error(tmp_path, monkeypatch):
    from scenarionet_pipelines.cli import progress

    echo, printed = click.echo, []
    monkeypatch.setattr(progress, "_SECONDS_BETWEEN_LINES", 0.02)
    monkeypatch.setattr(progress.click, "echo", lambda line, **how: (printed.append(str(line)), echo(line, **how)))
    raw = held_raw(tmp_path / "raw", shards=2)
    gate.close(raw, admitted=0)

    def admit() -> None:
        for words in ("0 of 2 shards", "1 of 2 shards"):
            until(lambda words=words: any(words in line for line in printed), f"a line says {words}")
            gate.admit(raw)

    beside = threading.Thread(target=admit)
    beside.start()
    lines = run("convert", NAME, raw, tmp_path / "lake", "--workers", 1).stderr.splitlines()
    beside.join()
    assert any(line.startswith(f"convert {NAME}: 0 of 2 shards after ") for line in lines)
    assert any("1 of 2 shards" in line and " scenarios/s, about " in line for line in lines)
    gate.open_(raw)
    assert run("convert", NAME, raw, tmp_path / "other", "--quiet").stderr == ""


# --- real processes -------------------------------------------------------------------------------------------


def start(*words: str | Path, **options) -> subprocess.Popen:
    return subprocess.Popen(
        [sys.executable, "-m", "scenarionet_pipelines.cli", *map(str, words)],
        **{"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, **options},
    )  # fmt: skip


def finished(lake: Path) -> int:
    """Number of finished shards, committed or not."""
    return len(list(lake.glob("metadata/*/*/*/*.parquet")))


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.long
def test_interrupted_run_is_continued(number, tmp_path, ok):
    raw, lake = held_raw(tmp_path / "raw", shards=10), tmp_path / "lake"
    gate.close(raw, admitted=3)
    # A session of its own: Ctrl-C reaches the workers too.
    log = tmp_path / "log"
    with log.open("w") as errors:
        running = start("convert", NAME, raw, lake, "--workers", 2, start_new_session=True, stderr=errors)
    until(lambda: ": 3 of 10 shards after" in log.read_text(), "the command knows that three shards are finished")
    if number == signal.SIGINT:
        os.killpg(running.pid, number)
    else:
        running.send_signal(number)
    gate.open_(raw)
    output, _ = running.communicate(timeout=HANGS_AFTER)
    assert running.returncode == 128 + number
    assert output == ""
    line = log.read_text().splitlines()[-1]  # after lines of progress
    assert line.startswith(("interrupted: ", "terminated: "))
    assert "run the same command again to continue" in line
    kept = len(Lake(lake))
    assert 9 <= kept < 30
    assert f"({kept} scenarios)" in line
    ok("convert", NAME, raw, lake, "--workers", 1)
    assert len(Lake(lake)) == 30


@pytest.mark.long
def test_workers_end_with_a_killed_command_and_their_shards_are_reused(tmp_path, as_json):
    raw, lake = held_raw(tmp_path / "raw", shards=10), tmp_path / "lake"
    gate.close(raw, admitted=3)
    running = start("convert", NAME, raw, lake, "--workers", 2)
    until(lambda: len(gate.waiting(raw)) == 2, "three shards are finished, two are being converted")
    assert finished(lake) == 3
    workers = psutil.Process(running.pid).children(recursive=True)
    running.kill()
    running.communicate()
    assert workers
    assert psutil.wait_procs(workers, timeout=HANGS_AFTER)[1] == []
    gate.open_(raw)
    report = as_json("convert", NAME, raw, lake, "--workers", 1, "--quiet")
    assert report["adopted"] == 3
    assert report["shards"] == 10
    assert len(Lake(lake)) == 30


@pytest.mark.long
def test_progress_bar_on_a_terminal(tmp_path):
    raw = write_raw(tmp_path / "raw", {"a": [1, 2], "b": ["3 slow"]})
    terminal, other_end = os.openpty()
    running = start("convert", NAME, raw, tmp_path / "lake", "--workers", 1, stderr=other_end)
    os.close(other_end)
    shown = b""
    try:
        while part := os.read(terminal, 4096):
            shown += part
    except OSError:  # Linux's error when the other end is closed
        pass
    output, _ = running.communicate(timeout=HANGS_AFTER)
    os.close(terminal)
    assert running.returncode == 0
    assert "converted" in output
    assert b"scenarios/s" in shown
    assert b"2/2" in shown


def test_validation_failure_is_quarantined_unless_no_check(tmp_path):
    raw = write_raw(tmp_path / "raw", {"a": ["1", "2 oneway", "3"]})
    name = "tests.scenarionet_data.quality.test_audit:OneWay"
    result = run("convert", name, raw, tmp_path / "lake", "--quiet")
    assert result.exit_code == 1
    assert "1 x InvalidScenario" in result.stdout
    assert "links are one-way" in result.stdout
    assert run("convert", name, raw, tmp_path / "other", "--quiet", "--no-check").exit_code == 0
