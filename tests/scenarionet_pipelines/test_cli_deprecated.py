"""Old spellings work and say the new one; advice for Python is translated for the command line."""

from __future__ import annotations

import pytest

from scenarionet_pipelines.cli.deprecated import MOVED, RENAMED_OPTIONS, current_options
from scenarionet_pipelines.cli.group import find_verb
from scenarionet_pipelines.messages import as_options
from tests.scenarionet_pipelines.conftest import run

pytestmark = pytest.mark.integration

RENAMED = [(verb, old, new) for verb, options in RENAMED_OPTIONS.items() for old, new in options.items()]


@pytest.mark.parametrize("old", MOVED)
def test_a_verb_that_moved_into_a_group_is_found_under_its_old_name(old):
    result = run(old, "--help")
    assert result.exit_code == 0
    new = " ".join(MOVED[old])
    assert result.stderr == f"note: `scenarionet {old}` is now `scenarionet {new}`\n"
    assert f"Usage: scenarionet {new} " in result.stdout


def test_old_verbs_are_not_in_the_help():
    assert "fsck  " not in run("--help").stdout


def test_an_old_verb_works(lake):
    old, new = run("compare-runs", lake, "a", "b"), run("runs", "compare", lake, "a", "b")
    assert (old.exit_code, old.stdout) == (new.exit_code, new.stdout)
    assert old.stderr.splitlines()[1:] == new.stderr.splitlines()


@pytest.mark.parametrize(("verb", "old", "new"), RENAMED)
def test_the_new_option_exists_and_the_old_one_does_not(verb, old, new):
    spellings = {spelling for param in find_verb(verb).params for spelling in (*param.opts, *param.secondary_opts)}
    assert new in spellings
    assert old not in spellings


def test_renamed_options_keep_their_values(capsys):
    words = ["pg", "-O", "density=3", "--option=num_blocks=2"]
    assert current_options("convert", words) == ["pg", "-p", "density=3", "--parameter=num_blocks=2"]
    assert current_options("list", words) == words
    assert capsys.readouterr().err.splitlines() == [
        "note: `-O` is now `-p`",
        "note: `--option` is now `--parameter`",
    ]


def test_a_renamed_option_still_works(raw, tmp_path):
    result = run("convert", "tests.fixtures.made:Made", raw, tmp_path / "lake", "-O", "num_objects=3", "--quiet")
    assert "note: `-O` is now `-p`" in result.stderr
    assert result.stdout.startswith("converted")


@pytest.mark.parametrize(
    ("advice", "expected"),
    [
        ("give another name, or replace=True for a new version", "give another name, or --replace for a new version"),
        ("or pass allow_empty=True", "or pass --allow-empty"),
        ("or check=False", "or --no-check"),
        ('`by="source_log"` keeps them together', "`--by source_log` keeps them together"),
        ('lake.rebase("busy") moves it', "`scenarionet db rebase LAKE busy` moves it"),
        ("dataset = 'waymo' and x=1", "dataset = 'waymo' and x=1"),
    ],
)
def test_python_advice_is_translated_to_options(advice, expected):
    assert as_options(advice) == expected
