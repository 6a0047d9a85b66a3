"""Run a script in the environment of another reader, and parse the JSON that it prints."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path
from typing import Any

import pytest

ENVIRONMENTS = Path(__file__).parents[2] / ".venv-devkits"


def read_with(environment: str, script: str, *arguments: str | Path) -> Any:
    """Output of a script in this folder for its arguments."""
    python = ENVIRONMENTS / environment / "bin" / "python"
    if not python.exists():
        pytest.skip("no .venv-devkits: run `make test-devkits`, or tests/devkits/make_environments.sh")
    clean = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    command = [python, Path(__file__).with_name(script), *arguments]
    done = subprocess.run(command, env=clean, capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == 0, done.stderr[-3000:]
    return json.loads(done.stdout)
