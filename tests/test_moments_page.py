"""The page about moments: its examples run in order, and it lists every relation."""

from __future__ import annotations

import shlex

import pytest
from click.testing import CliRunner

from scenarionet_data.query.named_sql import RELATIONS
from scenarionet_pipelines.cli import cli
from tests.fixtures.examples import ROOT, blocks

PAGE = "docs/guides/moments.md"


@pytest.mark.integration
def test_examples_run(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (command,), (code,) = blocks(PAGE, "bash"), blocks(PAGE, "python")
    result = CliRunner().invoke(cli, shlex.split(command)[1:])
    assert result.exit_code == 0, result.output
    found: dict = {}
    exec(code, found)
    assert len(found["lake"].moments(found["close_behind"])) > 0
    assert "BETWEEN a.ends AND a.ends + 3.0" in capsys.readouterr().out


def test_every_relation_is_named():
    text = (ROOT / PAGE).read_text("utf-8")
    assert [name for name in RELATIONS.names() if f"`{name}`" not in text] == []
