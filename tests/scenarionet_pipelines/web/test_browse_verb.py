"""The verb ``scenarionet browse``."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import urllib.request

import pytest

from tests.fixtures.waiting import HANGS_AFTER
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


@pytest.mark.long
def test_serves_until_interrupted(lake):
    started = subprocess.Popen(
        [sys.executable, "-m", "scenarionet_pipelines.cli", "browse", lake.root, "--port", "0", "--json"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=os.environ | {"PYTHONUNBUFFERED": "1"},
    )  # fmt: skip
    try:
        text = "".join(iter(started.stdout.readline, "}\n")) + "}"
        with urllib.request.urlopen(json.loads(text)["address"] + "api/about", timeout=HANGS_AFTER) as answer:
            assert json.load(answer)["scenarios"] == 59
        started.send_signal(signal.SIGINT)
        _, errors = started.communicate(timeout=HANGS_AFTER)
    finally:
        started.kill()
        started.communicate()
    assert started.returncode == 0
    assert errors == "stopped\n"
