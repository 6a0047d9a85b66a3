"""The page about events, views, user columns and statistics: its examples run, and it lists every event and view."""

from __future__ import annotations

import re
import shlex
import shutil

import pytest
from click.testing import CliRunner

from scenarionet_data.query.named_sql import EVENTS
from scenarionet_data.schema.package_data import SQL
from scenarionet_pipelines.cli import cli
from tests.fixtures.examples import ROOT, blocks
from tests.fixtures.lakes import write_lake
from tests.fixtures.moments import along, moment

PAGE = "docs/guides/events.md"


@pytest.mark.long
def test_examples_run(tmp_path, monkeypatch):
    """Run every command of the page in order, in this process, then its Python."""
    pytest.importorskip("matplotlib", reason="the extra `plots` is not installed")
    monkeypatch.chdir(tmp_path)
    text = "".join(blocks(PAGE, "bash"))
    commands = re.split(r"^(?=scenarionet )", text, flags=re.MULTILINE)[1:]
    assert len(commands) >= 20
    for command in commands:
        _, *words = shlex.split(command, comments=True)
        result = CliRunner().invoke(cli, words)
        assert result.exit_code == 0, command + result.output
    (code,) = blocks(PAGE, "python")
    exec(code, {})
    assert (tmp_path / "stats.svg").exists()


def test_every_event_and_view_is_named():
    text = (ROOT / PAGE).read_text("utf-8")
    assert [name for name in EVENTS.names() if f"`{name}`" not in text] == []
    of_files = {"metadata", "metadata_rows", "tracks", "lights", "maps", "shards", "quarantine", "defects", "steps"}
    of_checks, of_moments = {"lanes", "map_windows"}, {"moments", "moments_rows"}
    of_runs = {"results", "rollouts", "observations", "training", "frames"}
    views = {path.stem for path in (SQL / "views").glob("*.sql")} - of_files - of_checks - of_runs - of_moments
    assert [name for name in sorted(views) if f"`{name}`" not in text] == []


def test_example_event_is_found(tmp_path, monkeypatch):
    (text,) = blocks(PAGE, "sql")
    shutil.copytree(SQL / "events", tmp_path / "events")
    name = re.match(r"-- sql/events/(\w+)\.sql\n", text).group(1)
    (tmp_path / "events" / f"{name}.sql").write_text(text.split("\n", 1)[1])
    monkeypatch.setattr("scenarionet_data.query.named_sql.SQL", tmp_path)
    lake = write_lake(tmp_path / "lake", [moment("standing", along(0, 0, 5), car=along(9, 9))])
    assert [row[1:] for row in lake.mine(name).rows()] == [("car", None, 0, 100, 101.0)]
    assert lake.mine(name, {"min": 102}).is_empty()
