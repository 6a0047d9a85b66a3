"""The command that writes a catalogue, and its page."""

from __future__ import annotations

import json

import pytest
from click.testing import CliRunner

from scenarionet_data.query.named_sql import DISTURBANCES
from scenarionet_pipelines.cli import cli
from tests.fixtures.examples import ROOT
from tests.fixtures.lakes import write_lake
from tests.fixtures.planted import Noise, planted


@pytest.mark.integration
def test_a_catalogue_is_written_with_its_sql_and_computed_again(tmp_path):
    root = str(write_lake(tmp_path / "lake", planted(["cut_in", "cut_in", "cut_out"], 5, Noise())[0]).root)
    out = str(tmp_path / "catalogue")
    made = CliRunner().invoke(cli, ["db", "catalogue", root, "-o", out, "--json"])
    assert made.exit_code == 0, made.output
    rates = {row["definition"]: row for row in json.loads(made.stdout)["rates"]}
    assert {name: row["occurrences"] for name, row in rates.items()} == {
        "acceleration": 0, "cut_in": 2, "cut_out": 1, "deceleration": 0,
    }  # fmt: skip
    page = (tmp_path / "catalogue" / "catalogue.html").read_text("utf-8")
    assert page.count("<img") >= 6 and page.count("<summary>SQL</summary>") == 6
    assert "GROUPING SETS" in page and "our reading" in page
    again = CliRunner().invoke(cli, ["db", "rebuild", root, out])
    assert again.exit_code == 0 and "the same, to the last bit" in again.output
    refused = CliRunner().invoke(cli, ["db", "catalogue", root, "-o", out])
    assert refused.exit_code == 2 and "exists; choose another name" in refused.output


def test_the_guide_names_every_definition():
    text = (ROOT / "docs" / "guides" / "catalogue.md").read_text("utf-8")
    assert [name for name in DISTURBANCES.names() if f"| `{name}` |" not in text] == []
