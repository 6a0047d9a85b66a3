"""Renamed options: the old spelling works with a warning, and advice is translated for the command line."""

from __future__ import annotations

import click
import pytest

from scenarionet_pipelines.cli import cli
from scenarionet_pipelines.cli.advice import as_options
from scenarionet_pipelines.cli.deprecated import RENAMED_OPTIONS, current_spelling
from tests.scenarionet_pipelines.conftest import run

pytestmark = pytest.mark.integration

RENAMED = [(verb, old, new) for verb, options in RENAMED_OPTIONS.items() for old, new in options.items()]


@pytest.mark.parametrize(("verb", "old", "new"), RENAMED)
def test_the_new_option_exists_and_the_old_one_does_not(verb, old, new):
    command = cli.get_command(click.Context(cli), verb)
    spellings = {spelling for param in command.params for spelling in (*param.opts, *param.secondary_opts)}
    assert new in spellings
    assert old not in spellings


def test_renamed_options_keep_their_values(capsys):
    assert current_spelling("filter", ["lake", "--from=busy", "--to", "x"]) == [
        "lake",
        "--database=busy",
        "--name",
        "x",
    ]
    assert current_spelling("list", ["lake", "--to", "x"]) == ["lake", "--to", "x"]
    assert capsys.readouterr().err.splitlines() == [
        "warning: --from is now --database; the old name will be removed in the next release",
        "warning: --to is now --name; the old name will be removed in the next release",
    ]


def test_renamed_option_still_works(lake):
    result = run("filter", lake, "--to", "all")
    assert result.exit_code == 0
    assert result.stdout == "all@1: 9 scenarios\n"
    assert result.stderr == "warning: --to is now --name; the old name will be removed in the next release\n"


@pytest.mark.parametrize(
    ("advice", "expected"),
    [
        ("give another name, or replace=True for a new version", "give another name, or --replace for a new version"),
        ("or pass allow_empty=True", "or pass --allow-empty"),
        ("or check=False", "or --no-check"),
        ('`by="source_log"` keeps them together', "`--by source_log` keeps them together"),
        ('lake.rebase("busy") moves it', "`scenarionet rebase LAKE busy` moves it"),
        ("dataset = 'waymo' and x=1", "dataset = 'waymo' and x=1"),
    ],
)
def test_python_advice_is_translated_to_options(advice, expected):
    assert as_options(advice) == expected
