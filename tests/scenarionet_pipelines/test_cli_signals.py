"""Ctrl-C and SIGTERM end every verb in one line, with 130 and 143, whatever it is doing."""

from __future__ import annotations

import os
import shlex
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np
import psutil
import pytest

from scenarionet_data import Lake, Samples, Targets, TimeWindow
from scenarionet_data.forecasts import make_predictions, write_predictions
from scenarionet_pipelines.cli import interrupt
from scenarionet_pipelines.cli.group import find_verb
from scenarionet_pipelines.verb_tree import full_name
from scenarionet_sim import evaluate
from tests.fixtures.waiting import HANGS_AFTER, until
from tests.scenarionet_pipelines.conftest import run
from tests.scenarionet_pipelines.test_cli import ALL_VERBS
from tests.scenarionet_pipelines.test_cli_convert import start

pytestmark = pytest.mark.integration

UNENDING = "levenshtein(repeat('a', 1000000), repeat('b', 1000000)) > 0"
"""A condition within which DuckDB checks neither signals nor interrupts."""


@pytest.fixture
def _signals() -> Iterator[None]:
    yield
    interrupt._Received.number = None
    interrupt._Received.is_handled.clear()


def when_handled(process: subprocess.Popen) -> None:
    """Wait until the process has a handler of SIGTERM, or has ended."""
    status = Path(f"/proc/{process.pid}/status")

    def is_handled() -> bool:
        if process.poll() is not None:
            return True
        (caught,) = (line for line in status.read_text().splitlines() if line.startswith("SigCgt:"))
        return bool(int(caught.split()[1], 16) >> (signal.SIGTERM - 1) & 1)

    until(is_handled, "the process handles SIGTERM")


@pytest.mark.usefixtures("_signals")
@pytest.mark.parametrize("name", ALL_VERBS)
@pytest.mark.parametrize(
    ("number", "code", "word"), [(signal.SIGTERM, 143, "terminated"), (signal.SIGINT, 130, "interrupted")]
)
def test_signal_becomes_one_line_and_an_exit_code(name, number, code, word, monkeypatch):
    command = find_verb(name)
    monkeypatch.setattr(command, "callback", lambda **_: interrupt._interrupt(number, None))
    result = run(*shlex.split(command.examples[0])[1:])
    assert (result.exit_code, result.stdout, result.stderr) == (code, "", f"{word}: stopped before the end\n")


@pytest.mark.usefixtures("_signals")
def test_errors_after_a_signal_are_its_consequence(monkeypatch):
    def lose_workers(**_: object) -> None:
        try:
            interrupt._interrupt(signal.SIGTERM, None)
        except KeyboardInterrupt:
            raise RuntimeError("a worker ended") from None

    monkeypatch.setattr(find_verb("maintain check"), "callback", lose_workers)
    result = run("maintain", "check", "lake")
    assert (result.exit_code, result.stderr) == (143, "terminated: stopped before the end\n")


@pytest.mark.parametrize(
    "moment", ["os.kill(os.getpid(), signal.SIGTERM); cli.main()", "cli.CommandLine.make_context = end; cli.main()"]
)
def test_sigterm_before_a_verb_runs_ends_the_process(moment):
    code = (
        "import os, signal, sys\n"
        "from scenarionet_pipelines import cli\n"
        "from scenarionet_pipelines.cli import interrupt\n"
        "def end(*_, **__): os.kill(os.getpid(), signal.SIGTERM)\n"
        f"sys.argv[1:] = ['info', 'filters']\ninterrupt.handle_signals()\n{moment}"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (143, "", "terminated: stopped before the end\n")


def test_sigterm_during_an_import_ends_the_verb_after_it(lake, tmp_path):
    """As if the signal came while DuckDB starts, whose binding aborts the process if Python raises."""
    (tmp_path / "sitecustomize.py").write_text(
        "import importlib.abc, os, signal, sys\n"
        "class Finder(importlib.abc.MetaPathFinder):\n"
        "    def find_spec(self, name, path, target=None):\n"
        "        if name == 'duckdb' and not sys.stdin.closed:\n"
        "            sys.stdin.close()\n"
        "            os.kill(os.getpid(), signal.SIGTERM)\n"
        "            print('not interrupted', file=sys.stderr)\n"
        "sys.meta_path.insert(0, Finder())\n"
    )
    paths = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    running = start("filter", lake, "--where", UNENDING, "--name", "x", env=os.environ | {"PYTHONPATH": paths})
    output, errors = running.communicate(timeout=HANGS_AFTER)
    assert (running.returncode, output) == (143, "")
    assert errors == "not interrupted\nterminated: stopped before the end\n"


def test_sigterm_during_an_import_ends_a_call_right_after_it():
    """The main thread is never woken between the import and a call of compiled code that takes hours."""
    program = """
import hashlib, os, signal
from scenarionet_pipelines.cli.interrupt import handle_signals, interruptible
importing = {"__name__": "importlib._bootstrap", "os": os, "signal": signal, "hashlib": hashlib}
exec('''
def load():
    os.kill(os.getpid(), signal.SIGTERM)
    hashlib.pbkdf2_hmac("sha256", b"", b"", 2**31 - 1)
''', importing)
handle_signals()
with interruptible():
    importing["load"]()
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=HANGS_AFTER)
    assert (done.returncode, done.stdout, done.stderr) == (143, "", "terminated: stopped before the end\n")


def test_sigterm_ends_a_query_that_duckdb_cannot_interrupt(lake):
    running = start("filter", lake, "--where", UNENDING, "--name", "x")
    when_handled(running)
    process = psutil.Process(running.pid)
    until(lambda: process.cpu_times().user > 2 or running.poll() is not None, "the query runs")
    running.send_signal(signal.SIGTERM)
    output, errors = running.communicate(timeout=HANGS_AFTER)
    assert (running.returncode, output, errors) == (143, "", "terminated: stopped before the end\n")
    assert Lake(lake).databases == []


def work(process: psutil.Process) -> float:
    """Processor time of a process and its workers [s]."""
    found = 0.0
    for each in (process, *process.children(recursive=True)):
        with suppress(psutil.NoSuchProcess):
            found += each.cpu_times().user
    return found


@pytest.mark.long
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize(
    "words",
    [
        ["sql", "LAKE", f"SELECT {UNENDING}"],
        ["sql", "LAKE", "SELECT sum(a.range * b.range) FROM range(10000000) a, range(10000000) b"],
        ["maintain", "compile"],
        ["convert", "pg", "0:20000", "LAKE", "--workers", "2"],
        ["convert", "pg", "0:20000", "LAKE", "--workers", "2", "--cluster", "local"],
    ],
)
def test_no_process_is_left(words, number, lake, tmp_path):
    cache = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    running = start(*(str(lake) if word == "LAKE" else word for word in words), env=cache)
    process = psutil.Process(running.pid)
    until(lambda: running.poll() is not None or work(process) > 4, "it works")
    children = process.children(recursive=True)
    running.send_signal(number)
    _, errors = running.communicate(timeout=HANGS_AFTER)
    assert running.returncode == 128 + number, errors
    lines = [line for line in errors.splitlines() if not line.startswith(("compile", "convert", "cluster"))]
    assert len(lines) == 1, errors
    assert lines[0].startswith({signal.SIGINT: "interrupted: ", signal.SIGTERM: "terminated: "}[number])
    assert psutil.wait_procs(children, timeout=HANGS_AFTER)[1] == []


COMMANDS = {
    "convert": "pg 0:3 new", "converters": "", "list": "lake", "show": "lake made/v1/1", "sql": "lake summary",
    "mine": "lake hard_braking", "stats": "lake one", "files": "lake tracks", "render": "lake made/v1/1 -o a.png",
    "browse": "lake --port 0", "report": "lake -o report.html", "filter": "lake --name x", "filters": "",
    "split": "lake --fractions a=0.5 b=0.5", "sample": "lake -n 2 --name x",
    "vary": "lake one --name x -p ego.start=0:1 --number 2 --workers 1", "tag": "lake x --file rows.csv",
    "embed": "lake --name v", "similar": "lake made/v1/1 --by vectors",
    "merge": "lake one two --name x", "intersect": "lake one two --name x",
    "subtract": "lake one two --name x --allow-empty",
    "diff": "lake one two", "overlap": "lake one two", "lineage": "lake one", "rebuild": "lake one",
    "rebase": "lake one", "copy": "lake one x", "rename": "lake one x", "drop": "lake one",
    "catalogue": "lake -o catalogue",
    "submit": "lake forecast.parquet out.parquet --format argoverse2", "compare": "lake before after",
    "checkout": "lake one@1", "score": "lake forecast.parquet",
    "fit": "lake one -p epochs=1", "sim": "lake --policy replay --workers 2",
    "record": "lake --workers 1", "verify": "lake before", "films": "lake before -o films",
    "add": "lake played --name theirs", "bridge": "ros2 lake",
    "search": "lake cut_in --policy idm --name x -p ego_speed=25 -p lateral_time=4", "train": "ppo lake --size small",
    "regress": "lake one --policy constant-planner idm-planner", "experiment": "cross-dataset lake -o out --workers 1",
    "export": "lake one out", "pack": "lake one packed",
    "learn": "lake one --name x", "generate": "lake one --model before --name x", "measure": "lake one --model before",
    "publish": "lake --iceberg catalog", "check": "lake", "fsck": "lake --deep", "compact": "lake",
    "vacuum": "lake --keep-last 1", "doctor": "lake", "compile": "",
}  # fmt: skip
"""Real work of every verb in a folder with the lake ``lake`` and its databases ``one`` and ``two``."""


def test_work_of_every_verb_is_known():
    assert {*map(full_name, COMMANDS)} == {*ALL_VERBS}


def write_forecast(lake: Path) -> Path:
    """Write a forecast of one target, 6 s long."""
    samples = Samples(lake, window=TimeWindow(history=0.2, future=0.2), targets=Targets("ego"))
    rows = make_predictions([samples.key(0)], np.zeros((1, 1, 60, 2)), np.ones((1, 1)), samples.batch([0])["pose"], 0.1)
    write_predictions(lake.parent / "forecast.parquet", [rows])
    return lake.parent / "forecast.parquet"


@pytest.mark.long
@pytest.mark.parametrize("name", ALL_VERBS)
def test_sigterm_at_any_time_ends_every_verb(name, lake, tmp_path):
    opened = Lake(lake)
    for one in ("true", "num_objects > 0"):
        opened.filter(one, name="one", replace=True)
    opened.filter("num_objects > 2", name="two")
    opened.embed("vectors")
    for before_or_after in ("before", "after") if name in ("runs compare", "runs verify", "runs films") else ():
        evaluate(lake, policy="replay", name=before_or_after)
    ids = opened.sql("SELECT scenario_id FROM metadata")["scenario_id"]
    forecast = write_forecast(lake)
    for index, delay in enumerate((0.0, 0.2, 0.5, 1.0, 2.0, 4.0)):
        place = Path(shutil.copytree(lake, tmp_path / str(index) / "lake")).parent
        if name == "runs add":
            shutil.copytree(place / "lake", place / "played")
        (place / "rows.csv").write_text("scenario_id,mark\n" + "".join(f"{each},1\n" for each in ids))
        shutil.copy(forecast, place)
        words = COMMANDS[name.split()[-1]].replace("made/v1/1", ids[0])
        running = start(*name.split(), *shlex.split(words), cwd=place)
        when_handled(running)
        time.sleep(delay)  # any moment will do
        running.send_signal(signal.SIGTERM)
        _, errors = running.communicate(timeout=HANGS_AFTER)
        assert "Traceback" not in errors
        if running.returncode == 143:
            assert errors.splitlines()[-1].startswith("terminated: "), errors
            assert "error: " not in errors and errors.count("terminated: ") == 1, errors
        else:  # it was faster than the signal, which may still end the interpreter's own exit
            assert running.returncode in (0, 1, -signal.SIGTERM) and name != "browse", errors
            assert "terminated: " not in errors
        assert Lake(place / "lake").sql("SELECT count(*) FROM metadata").item() == len(ids)
