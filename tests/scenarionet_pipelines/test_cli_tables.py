"""Tables that verbs print."""

from __future__ import annotations

import sys

import pytest

from scenarionet_pipelines.cli.output import print_table
from tests.fixtures.lakes import write_lake
from tests.fixtures.scenarios import make_scenario, renamed

LONG_ID = "made/v1/" + "0123456789abcdef" * 8
TEXT = "a text of many words " * 10


@pytest.mark.parametrize("is_terminal", [True, False])
def test_only_texts_on_a_terminal_are_shortened(is_terminal, capsys, monkeypatch):
    monkeypatch.setattr(sys.stdout, "isatty", lambda: is_terminal)
    print_table([(LONG_ID, TEXT)], max_cell=60)
    printed = capsys.readouterr().out
    assert LONG_ID in printed
    assert (TEXT.strip() in printed) is not is_terminal
    assert printed.rstrip().endswith("…") is is_terminal


@pytest.mark.parametrize("is_terminal", [True, False])
def test_ids_are_whole_on_terminals_and_in_pipes(is_terminal, tmp_path, ok, monkeypatch):
    name = "0123456789abcdef" * 8
    lake = write_lake(tmp_path / "lake", [renamed(make_scenario(1), name), make_scenario(2)]).root
    monkeypatch.setattr("click.testing._NamedTextIOWrapper.isatty", lambda _: is_terminal, raising=False)
    ok("filter", lake, "--where", "true", "--name", "both")
    ok("filter", lake, "--where", f"scenario_id <> 'made/v1/{name}'", "--name", "one")
    for words in (
        ("sql", lake, "SELECT * FROM metadata"),
        ("sql", lake, "SELECT scenario_id, count(*) FROM states GROUP BY 1"),
        ("show", lake, name[-20:]),
        ("db", "diff", lake, "both", "one"),
        ("mine", lake, "minimum_gap"),
    ):
        assert f"made/v1/{name}" in ok(*words), words
