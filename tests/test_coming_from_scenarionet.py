"""The README's table of ScenarioNet's scripts: every script is in it, and what stands beside it can be typed."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import click
import pytest

from scenarionet_pipelines.cli import cli

README = (Path(__file__).parents[1] / "README.md").read_text("utf-8")
SCRIPTS = {
    "check_existence", "check_overlap", "check_simulation", "convert_argoverse2", "convert_nuplan", "convert_nuscenes",
    "convert_pg", "convert_waymo", "cp", "filter", "generate_from_error_file", "list", "merge", "num", "sim", "split",
}  # fmt: skip
"""What `python -m scenarionet.list` lists in ScenarioNet 0.1.1."""

SECTION = README.partition("## Coming from ScenarioNet")[2].partition("\n## ")[0]
ROWS = [line.strip("| ").split(" | ") for line in SECTION.splitlines() if line.startswith("| ") and "---" not in line]
COMMANDS = re.findall(r"`(scenarionet [^`]+)`", SECTION)


def test_every_script_is_there():
    found = {word.split()[0] for left, _ in ROWS[1:] for word in re.findall(r"`([^`]+)`", left)}
    assert {word for word in found if not word.startswith("-")} == SCRIPTS


def test_every_row_says_what_to_type():
    assert len(ROWS) >= 20
    assert [left for left, right in ROWS[1:] if "`" not in right] == []


@pytest.mark.parametrize("command", COMMANDS)
def test_can_be_typed(command):
    """Parsed, not run: the verb exists, and takes these arguments and options."""
    words = shlex.split(command)[1:]
    if words == ["--help"]:
        return
    verb = cli.get_command(click.Context(cli), words[0])
    verb.make_context(words[0], words[1:])
