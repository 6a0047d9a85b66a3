"""A small lake and helpers that run commands on it."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

from scenarionet_data.conversion import convert
from scenarionet_pipelines import machine
from scenarionet_pipelines.cli import cli
from tests.fixtures.made import NAME, write_raw

SHARDS = {"a": ["1", "2", "3", "4", "5", "6"], "b": ["11", "12", "13", "7 invalid"]}


def run(*words: str | Path) -> Result:
    """Invoke a command in this process, with one worker by default; output and errors are separate in the result."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(machine, "default_workers", lambda: 1)
        return CliRunner().invoke(cli, [str(word) for word in words])


@pytest.fixture
def raw(tmp_path: Path) -> Path:
    """Raw recordings: nine good scenarios, one that is quarantined."""
    return write_raw(tmp_path / "raw", SHARDS)


@pytest.fixture(scope="session")
def _converted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("converted")
    convert(NAME, str(write_raw(folder / "raw", SHARDS)), folder / "lake")
    return folder / "lake"


@pytest.fixture
def lake(_converted: Path, tmp_path: Path) -> Path:
    """A private copy of a lake with the converted recordings."""
    return Path(shutil.copytree(_converted, tmp_path / "lake"))


@pytest.fixture
def ok() -> Callable[..., str]:
    """Run a command that must succeed and return its output."""

    def run_it(*words: str | Path) -> str:
        result = run(*words)
        assert result.exit_code == 0, result.output
        return result.stdout

    return run_it


@pytest.fixture
def as_json(ok: Callable[..., str]) -> Callable[..., Any]:
    """Run a command with ``--json`` and return the printed object."""
    return lambda *words: json.loads(ok(*words, "--json"))
