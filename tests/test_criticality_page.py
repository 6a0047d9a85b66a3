"""The page about criticality: its tables are those of the code, and its examples run.

``python -m tests.test_criticality_page`` writes the tables into the page.
"""

from __future__ import annotations

import json
import re
import shlex

import pytest
from click.testing import CliRunner

from scenarionet_data.criticality import LEFT_OUT, MEASURES
from scenarionet_pipelines.cli import cli
from tests.fixtures.examples import ROOT, blocks

PAGE = "docs/guides/criticality.md"
FIGURES = ROOT / "tests" / "fixtures" / "criticality_figures.json"
RECORDED = ROOT / "tests" / "fixtures" / "criticality_recorded.json"


def tables() -> dict[str, str]:
    """Return the tables of the page by name."""
    generated, recorded = (json.loads(path.read_text("utf-8")) for path in (FIGURES, RECORDED))
    rows = [
        "| measure | what it says | formula | unit | source | generated scenes | recorded scenes |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for name, each in MEASURES.items():
        formula = each.formula.replace("|", "&#124;")
        compared = [
            f"{found['values']:,}, {found['finite']:,}: {found['largest']:.1g}" if (found := figures.get(name)) else "-"
            for figures in (generated, recorded)
        ]
        rows.append(
            f"| `{name}` | {each.doc} | <code>{formula}</code> | {each.unit} | {each.source} | {' | '.join(compared)} |"
        )
    left_out = ["| measure | why |", "| --- | --- |", *(f"| `{name}` | {why} |" for name, why in LEFT_OUT.items())]
    return {"measures": "\n".join(rows), "left out": "\n".join(left_out)}


def filled(text: str) -> str:
    """Return the page with its tables."""
    for name, table in tables().items():
        text = re.sub(
            rf"(<!-- table: {name} -->\n).*?(<!-- end of table -->)",
            lambda m, t=table: f"{m[1]}{t}\n{m[2]}",
            text,
            flags=re.S,
        )
    return text


def test_tables_are_those_of_the_code():
    text = (ROOT / PAGE).read_text("utf-8")
    assert text == filled(text), "python -m tests.test_criticality_page writes them"


@pytest.mark.integration
def test_examples_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (command,), (code,) = blocks(PAGE, "bash"), blocks(PAGE, "python")
    result = CliRunner().invoke(cli, shlex.split(command)[1:])
    assert result.exit_code == 0, result.output
    found: dict = {}
    exec(code, found)
    assert len(found["rows"]) > 0


if __name__ == "__main__":
    path = ROOT / PAGE
    path.write_text(filled(path.read_text("utf-8")), "utf-8")
