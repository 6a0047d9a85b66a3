"""The verb ``scenarionet browse``."""

from __future__ import annotations

import http.client
import json
import os
import signal
import subprocess
import sys
import threading
import urllib.parse
import urllib.request
from contextlib import suppress

import psutil
import pytest

from tests.fixtures.waiting import HANGS_AFTER, until
from tests.scenarionet_pipelines.conftest import run

pytestmark = pytest.mark.integration


def test_help_shows_examples():
    text = run("browse", "--help").output
    assert "scenarionet browse lake --open --write" in text
    assert "only this machine can connect and the lake is read-only" in " ".join(text.split())


def test_folder_without_lake(tmp_path):
    result = run("browse", tmp_path)
    assert result.exit_code == 1
    assert "no lake there" in result.stderr


def test_missing_packages_have_a_remedy(tmp_path):
    code = (
        "import sys; sys.modules.update(dict.fromkeys(('starlette', 'uvicorn')))\n"
        f"sys.argv[1:] = ['browse', {str(tmp_path)!r}]; from scenarionet_pipelines.cli import main; main()"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr.startswith("error: browsing needs a web server: pip install 'scenarionet-lake[web]'")


def ask_without_end(address):
    """Begin to ask the server for something that takes longer than its limit."""
    where = urllib.parse.quote("levenshtein(repeat('a', 1000000), repeat('b', 1000000)) > 0")

    def ask() -> None:
        with suppress(OSError, http.client.HTTPException), urllib.request.urlopen(f"{address}api/rows?where={where}"):
            pass

    threading.Thread(target=ask, daemon=True).start()


@pytest.mark.parametrize("is_busy", [False, True])
def test_serves_until_interrupted(lake, is_busy):
    started = subprocess.Popen(
        [sys.executable, "-m", "scenarionet_pipelines.cli", "browse", lake.root, "--port", "0", "--json"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=os.environ | {"PYTHONUNBUFFERED": "1"},
    )  # fmt: skip
    try:
        address = json.loads("".join(iter(started.stdout.readline, "}\n")) + "}")["address"]
        with urllib.request.urlopen(address + "api/about", timeout=HANGS_AFTER) as answer:
            assert json.load(answer)["scenarios"] == 59
        if is_busy:
            ask_without_end(address)
            until(lambda: work(psutil.Process(started.pid).children(recursive=True)) > 2, "it looks for the answer")
        started.send_signal(signal.SIGINT)
        _, errors = started.communicate(timeout=HANGS_AFTER)
    finally:
        started.kill()
        started.communicate()
    assert started.returncode == 0
    assert errors == "stopped\n"


def work(processes):
    """Processor time of some processes [s]."""
    found = 0.0
    for process in processes:
        with suppress(psutil.NoSuchProcess):
            found += process.cpu_times().user
    return found
