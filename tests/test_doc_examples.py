"""The commands, code and extensions of the documentation run."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import warnings

import click
import polars as pl
import pytest
from click.testing import CliRunner

from scenarionet_data import Lake
from scenarionet_data.quality import rules
from scenarionet_data.schema import package_data
from scenarionet_pipelines.cli import cli
from tests.fixtures.argoverse2 import write_forecasting
from tests.fixtures.examples import ROOT, blocks, commands, run_blocks
from tests.fixtures.lakes import write_lake
from tests.fixtures.scenarionet_pickles import write_vintages
from tests.fixtures.scenarios import make_scenario
from tests.fixtures.waymo import scenario_bytes, write_tfrecord

pytestmark = pytest.mark.integration


def test_readme_examples_run(monkeypatch, tmp_path):
    assert run_blocks("README.md", monkeypatch, tmp_path) == 8


@pytest.mark.long
def test_first_tutorial_runs(monkeypatch, tmp_path):
    pytest.importorskip("matplotlib", reason="the extra `plots` is not installed")
    assert run_blocks("docs/tutorials/first_lake.md", monkeypatch, tmp_path) == 9


@pytest.mark.long
def test_driving_tutorial_runs(monkeypatch, tmp_path):
    assert run_blocks("docs/tutorials/drive_and_evaluate.md", monkeypatch, tmp_path) == 6


@pytest.mark.long
def test_loading_examples_run(monkeypatch, tmp_path):
    assert run_blocks("docs/guides/load.md", monkeypatch, tmp_path) == 2


@pytest.mark.long
def test_conversion_examples_run(monkeypatch, tmp_path):
    """With recordings next to the lake."""
    write_tfrecord(tmp_path / "recordings/waymo/training/training.tfrecord-00000-of-01000", [scenario_bytes(1)])
    write_forecasting(tmp_path / "recordings/argoverse2/val", num_scenarios=2, seed=0)
    write_vintages(tmp_path / "recordings/pickles")
    assert run_blocks("docs/guides/convert.md", monkeypatch, tmp_path) == 4


@pytest.mark.long
def test_evaluation_examples_run(monkeypatch, tmp_path):
    assert run_blocks("docs/guides/evaluation.md", monkeypatch, tmp_path) >= 5
    runs = Lake(tmp_path / "lake").named_query("runs")
    planner = runs.filter(run="driven-my_planner.Planner-replay-kinematic")
    assert planner["success"].item() > 0.8, "the page's planner follows its route"


@pytest.mark.long
def test_planner_examples_run(monkeypatch, tmp_path):
    assert run_blocks("docs/guides/planners.md", monkeypatch, tmp_path) == 4
    page = blocks("docs/guides/planners.md", "python")[0]
    assert len(page.strip().splitlines()) <= 30
    mine = Lake(tmp_path / "lake").named_query("runs").filter(run="mine")
    assert mine["success"].item() > 0.8 and mine["nuplan_score"].item() > 0.4, "the page's planner drives"


@pytest.mark.long
def test_cluster_examples_run(monkeypatch, tmp_path):
    (profile,) = blocks("docs/guides/cluster.md", "toml")
    (tmp_path / "mine.toml").write_text(profile)
    assert run_blocks("docs/guides/cluster.md", monkeypatch, tmp_path) == 2
    assert len(Lake(tmp_path / "lake")) == 192


def test_simulator_examples_run(monkeypatch, tmp_path):
    assert run_blocks("docs/guides/simulator.md", monkeypatch, tmp_path) >= 5


@pytest.mark.long
def test_picture_examples_run(monkeypatch, tmp_path):
    assert run_blocks("docs/guides/pictures.md", monkeypatch, tmp_path) == 4
    written = {path.name for path in tmp_path.iterdir()}
    assert {
        "scenario.svg",
        "speeds.png",
        "two.pdf",
        "eight.png",
        "scenario.gif",
        "comparison.svg",
    } <= written


def test_table_examples_run(monkeypatch, tmp_path):
    page = "docs/guides/tables.md"
    told, *_ = blocks(page, "toml")
    for name, (text,) in (("tracks.csv", blocks(page, "csv")), ("map.geojson", blocks(page, "json"))):
        (tmp_path / name).write_text(text)
    (tmp_path / "columns.toml").write_text(told)
    assert run_blocks(page, monkeypatch, tmp_path) == 2
    lake = Lake(tmp_path / "lake")
    assert lake.sql("SELECT num_objects, num_map_features FROM metadata").rows() == [(2, 3), (2, 3)]
    assert lake.sql("SELECT count(*) FROM defects").item() == 0


@pytest.mark.long
def test_browse_examples_run(monkeypatch, tmp_path):
    """Commands that serve a page are only parsed: they run until Ctrl-C."""
    assert run_blocks("docs/guides/browse.md", monkeypatch, tmp_path) == 1
    assert (tmp_path / "compared.html").stat().st_size > 10_000
    served = [line for line in "".join(blocks("docs/guides/browse.md", "sh")).splitlines() if "browse" in line]
    assert len(served) == 2
    for command in served:
        words = shlex.split(command)[1:]
        cli.get_command(click.Context(cli), words[0]).make_context(words[0], words[1:])


@pytest.mark.long
def test_sensor_examples_run(monkeypatch, tmp_path):
    assert run_blocks("docs/guides/sensors.md", monkeypatch, tmp_path) == 3


@pytest.mark.long
def test_database_examples_run(tmp_path, monkeypatch):
    """Run every command of the page in order, in this process, then its Python; warnings are expected."""
    monkeypatch.chdir(tmp_path)
    commands = [line for block in blocks("docs/guides/databases.md", "bash") for line in block.splitlines()]
    assert len(commands) >= 25
    with warnings.catch_warnings():
        warnings.simplefilter("default")
        for command in commands:
            program, *words = shlex.split(command)
            assert program == "scenarionet"
            result = CliRunner().invoke(cli, words)
            assert result.exit_code == 0, command + result.output
        codes = blocks("docs/guides/databases.md", "python")
        assert len(codes) == 2
        for code in codes:
            exec(code, {})


@pytest.mark.long
def test_maintenance_examples_run(monkeypatch, tmp_path):
    assert run_blocks("docs/guides/maintenance.md", monkeypatch, tmp_path) == 1


@pytest.mark.long
def test_checks_page_runs(tmp_path, monkeypatch):
    """Run its commands with its example rule added."""
    (rule,) = blocks("docs/guides/checks.md", "sql")
    shutil.copytree(package_data.SQL, tmp_path / "sql")
    (tmp_path / rule.splitlines()[0].removeprefix("-- ")).write_text(rule.split("\n", 1)[1])
    monkeypatch.setattr("scenarionet_data.query.named_sql.SQL", tmp_path / "sql")
    monkeypatch.chdir(tmp_path)
    lake = write_lake("lake", [make_scenario(1, num_objects=1, num_lanes=1), make_scenario(2, num_lanes=1)])
    typed = "".join(blocks("docs/guides/checks.md", "bash")).splitlines()
    lines = [line.partition("#")[0].split() for line in typed]
    results = [CliRunner().invoke(cli, line[1:]) for line in lines]
    assert [result.exit_code for result in results] == [0] * 3, results[0].output
    assert "ego_is_alone             1  50.00%  made/v1/s000001: no other object" in results[0].output
    assert pl.read_csv("scorecard.csv").height == len(rules.names())
    assert len(lake.database("good")) == 2
    assert pl.read_parquet("broken.parquet")["scenario_id"].to_list() == [make_scenario(1).id]


@pytest.mark.long
def test_example_converter_passes_its_conformance_test(tmp_path):
    """Run the page's two Python blocks as a module and its test, outside the repository."""
    converter, test = blocks("docs/guides/adding_a_dataset.md", "python")
    (tmp_path / "my_datasets.py").write_text(converter)
    (tmp_path / "test_my_datasets.py").write_text("from my_datasets import CsvTrajectories\n" + test)
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_my_datasets.py"],
        cwd=tmp_path, env={"PYTHONPATH": f"{ROOT}:{tmp_path}", "PATH": ""}, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert re.search(r"\d+ passed", done.stdout)
    assert "skipped" not in done.stdout


@pytest.mark.long
def test_example_converter_installs_as_a_package(tmp_path):
    """Build and install the page's package by its own commands, into a separate folder."""
    page = "docs/guides/adding_a_dataset.md"
    package = tmp_path / "my-datasets"
    package.mkdir()
    (package / "my_datasets.py").write_text(blocks(page, "python")[0])
    (package / "pyproject.toml").write_text(blocks(page, "toml")[0])
    (tmp_path / "recordings").mkdir()
    rows = "".join(f"{k / 10},ego,car,{k},0,0,10\n" for k in range(30))
    (tmp_path / "recordings" / "first.csv").write_text("t,id,kind,x,y,heading,speed\n" + rows)
    environment = os.environ | {
        "PYTHONPATH": f"{ROOT}:{tmp_path / 'installed'}",
        "PATH": f"{commands(tmp_path, 'pip=pip', 'scenarionet=scenarionet_pipelines.cli')}:{os.environ['PATH']}",
        # Options of pip: dependencies are installed already, nothing is downloaded.
        "PIP_TARGET": str(tmp_path / "installed"),
        "PIP_NO_DEPS": "1",
        "PIP_NO_INDEX": "1",
        "PIP_NO_BUILD_ISOLATION": "0",
        "PIP_DISABLE_PIP_VERSION_CHECK": "1",
    }
    (typed,) = blocks(page, "bash")
    asked = "scenarionet info converters --json > listed.json\n"
    asked += "scenarionet sql lake 'SELECT * FROM metadata' --json > rows.json"
    done = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", f"{typed}\n{asked}"],
        cwd=tmp_path, env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    listed = {each["name"]: each for each in json.loads((tmp_path / "listed.json").read_text())["converters"]}
    assert {"csv", "waymo"} <= set(listed)
    assert listed["csv"]["raw"] == "a folder of *.csv files, one scenario each"
    (row,) = json.loads((tmp_path / "rows.json").read_text())["rows"]
    assert (row["scenario_id"], row["source_file"]) == ("csv/v1/first", "first.csv")


@pytest.mark.long
def test_extensions_of_the_architecture_page_work(tmp_path):
    """Copy schemas and SQL, add the page's examples to the copy, and use them."""
    code = """
import shutil, sys
from pathlib import Path
from scenarionet_data.schema import package_data
copy = Path(sys.argv[1])
shutil.copytree(package_data.SCHEMAS, copy / "schemas"); shutil.copytree(package_data.SQL, copy / "sql")
package_data.SCHEMAS, package_data.SQL = copy / "schemas", copy / "sql"
column, *queries = sys.argv[2:]
with (copy / "schemas/metadata.toml").open("a") as file: file.write(column)
for text in queries:
    path = copy / text.splitlines()[0].removeprefix("-- ")
    path.write_text(text.split("\\n", 1)[1])
from scenarionet_data import Lake
from scenarionet_data.conversion import convert
from scenarionet_data.quality.checks import run_checks
from tests.fixtures.made import NAME, write_raw
raw = write_raw(copy / "raw", {"a": list(range(4))})
convert(NAME, str(raw), copy / "lake")
lake = Lake(copy / "lake")
assert (lake.sql("SELECT mean_object_speed_kmh AS v FROM metadata")["v"] > 30).all()
assert 0 < len(lake.filter(name="crowded", filters=["crowded:per_100m=10"])) <= 4
(result,) = [r for r in run_checks(lake, names=["ego_moves_backwards"]).results if r.name == "ego_moves_backwards"]
assert result.doc
"""
    page = "docs/explanation/architecture.md"
    (column,), (filter_, check) = blocks(page, "toml"), blocks(page, "sql")
    done = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path), column, filter_, check],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
