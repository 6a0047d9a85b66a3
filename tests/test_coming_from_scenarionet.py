"""The table of ScenarioNet's scripts is complete, and the commands in it parse."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import click
import pytest

from scenarionet_pipelines.cli import cli

PAGE = (Path(__file__).parents[1] / "docs" / "guides" / "coming_from_scenarionet.md").read_text("utf-8")
SCRIPTS = {
    "check_existence", "check_overlap", "check_simulation", "convert_argoverse2", "convert_nuplan", "convert_nuscenes",
    "convert_pg", "convert_waymo", "cp", "filter", "generate_from_error_file", "list", "merge", "num", "sim", "split",
}  # fmt: skip
"""Scripts listed by `python -m scenarionet.list` in ScenarioNet 0.1.1."""

TABLE = PAGE.partition("\n| ScenarioNet: ")[2].partition("\n\n")[0]
ROWS = [line.strip("| ").split(" | ") for line in TABLE.splitlines() if line.startswith("| ") and "---" not in line]
COMMANDS = re.findall(r"`(scenarionet [^`]+)`", PAGE)


def test_table_has_every_script():
    found = {word.split()[0] for left, _ in ROWS for word in re.findall(r"`([^`]+)`", left)}
    assert {word for word in found if not word.startswith("-")} == SCRIPTS


def test_every_row_has_a_command():
    assert len(ROWS) >= 20
    assert [left for left, right in ROWS if "`" not in right] == []


@pytest.mark.parametrize("command", COMMANDS)
def test_command_parses(command):
    """The verb exists and accepts these arguments and options; nothing runs."""
    words = shlex.split(command)[1:]
    if words == ["--help"]:
        return
    verb = cli.get_command(click.Context(cli), words[0])
    verb.make_context(words[0], words[1:])
