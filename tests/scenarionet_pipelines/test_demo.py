"""``make demo``: runs repeatedly and does not touch foreign folders."""

from __future__ import annotations

import shlex

import click
import pytest
from click.testing import CliRunner

from scenarionet_data import Lake, ScenarioLoader
from scenarionet_pipelines import demo


@pytest.mark.long  # compiling the generator takes half a minute
def test_demo_twice(tmp_path):
    for _ in range(2):
        result = CliRunner().invoke(click.command()(lambda: demo.run(str(tmp_path / "demo"), 12)))
        assert result.exit_code == 0, result.output
    lake = Lake(tmp_path / "demo" / "lake")
    assert len(lake) == 12
    assert {"busy", "busy_train", "busy_val"} == set(lake.databases)
    assert len(ScenarioLoader(lake, "busy_train")) + len(ScenarioLoader(lake, "busy_val")) == len(lake.database("busy"))
    assert (tmp_path / "demo" / "pickles" / "dataset_summary.pkl").exists()
    typed = [line.removeprefix("$ ") for line in result.stdout.splitlines() if line.startswith("$ scenarionet ")]
    assert [shlex.split(line)[1] for line in typed] == ["convert", "list", "sql", "filter", "split", "render", "export"]
    assert "total" in result.stdout


def test_failing_step_ends_the_demo(tmp_path, capsys):
    with pytest.raises(SystemExit) as ended:
        demo._command("list", str(tmp_path))()
    assert ended.value.code == 1
    assert capsys.readouterr().out == f"$ scenarionet list {tmp_path}\n"


def test_foreign_folder_is_not_removed(tmp_path):
    (tmp_path / "precious").touch()
    result = CliRunner().invoke(demo.main, [str(tmp_path)])
    assert result.exit_code == 2
    assert "was not made by the demo" in result.stderr
    assert (tmp_path / "precious").exists()
