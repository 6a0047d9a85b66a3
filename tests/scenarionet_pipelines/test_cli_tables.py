"""Tables that verbs print."""

from __future__ import annotations

import sys

import pytest

from scenarionet_pipelines.cli.output import print_table

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
