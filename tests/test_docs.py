"""What the documentation shows is true: its code runs, its tables are up to date."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import warnings
from dataclasses import asdict
from pathlib import Path

import click
import polars as pl
import pytest
from click.testing import CliRunner

from pipelines import notebooks
from pipelines.cli import cli
from pipelines.cluster import profile as profiles
from scenarionet_data import Lake, converters, dictionary, resources, tables
from scenarionet_data.catalog import rules
from scenarionet_sim import sensors
from tests.fixtures.argoverse2 import write_forecasting
from tests.fixtures.lakes import write_lake
from tests.fixtures.scenarionet_pickles import write_vintages
from tests.fixtures.scenarios import make_scenario
from tests.fixtures.waymo import scenario_bytes, write_tfrecord

ROOT = Path(__file__).parents[1]


def blocks(page: str, language: str) -> list[str]:
    """Fenced code blocks of a page."""
    text = (ROOT / page).read_text("utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


def commands(folder: Path, *modules: str) -> Path:
    """A folder of programs that run modules of this Python, each given as ``program=module``."""
    (folder / "bin").mkdir()
    for pair in modules:
        name, _, module = pair.partition("=")
        (folder / "bin" / name).write_text(f'#!/bin/sh\nexec {sys.executable} -m {module} "$@"\n')
        (folder / "bin" / name).chmod(0o755)
    return folder / "bin"


def test_the_tests_that_the_simulator_s_page_names_are_there():
    page, folder = (ROOT / "docs" / "simulator.md").read_text("utf-8"), ROOT / "tests" / "scenarionet_sim"
    named = re.findall(r"`([\w/]*test_\w+\.py)?(?:::(test_\w+))?`", page)
    at = ""
    for file, test in named:
        at = file or at
        if file or test:
            assert f"def {test}" in (folder / at).read_text("utf-8"), (at, test)
    assert sum(bool(test) for _, test in named) > 15


def test_data_dictionary_is_up_to_date():
    written = (ROOT / "docs" / "data_dictionary.md").read_text("utf-8")
    assert written == dictionary.markdown(), "run `make docs`"
    readme = (ROOT / "README.md").read_text("utf-8")
    assert readme == dictionary.into_page(readme), "run `make docs`"


def run_blocks(page: str, monkeypatch: pytest.MonkeyPatch, folder: Path) -> int:
    """Run every bash and python block of a page, in order, in one folder; returns how many there are.

    A python block whose first line names a file is written there instead. Python and commands of ours run in this
    process, which saves each some seconds of imports; what is more than one command runs in a shell.
    """
    programs = commands(folder, "scenarionet=pipelines.cli")
    environment = os.environ | {"PYTHONPATH": str(ROOT), "PATH": f"{programs}:{os.environ['PATH']}"}
    monkeypatch.chdir(folder)
    monkeypatch.syspath_prepend(folder)
    text = (ROOT / page).read_text("utf-8")
    found = re.findall(r"^```(bash|python)\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    for language, code in found:
        name = re.match(r"# (\w+\.py)\n", code)
        if name:
            (folder / name.group(1)).write_text(code)
        elif language == "python":
            exec(compile(code, page, "exec"), {"__name__": "__main__"})
        else:
            for command in split_commands(code):
                words = shlex.split(command, comments=True)
                if words[:1] == ["scenarionet"] and not {">", "|", "&&"} & set(words):
                    result = CliRunner().invoke(cli, words[1:])
                    assert result.exit_code == 0, command + result.output
                elif words:
                    run(["bash", "-euo", "pipefail", "-c", command], environment)
    return len(found)


def run(command: list[str], environment: dict[str, str]) -> None:
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, command[-1] + done.stdout + done.stderr


def split_commands(block: str) -> list[str]:
    """A block's commands; one goes on over line ends while a quote is open."""
    found, begun = [], ""
    for line in block.splitlines():
        begun += line
        try:
            shlex.split(begun, comments=True)
        except ValueError:
            begun += "\n"
        else:
            found.append(begun)
            begun = ""
    assert not begun, begun
    return found


def test_readme_examples_run(monkeypatch, tmp_path):
    """With recordings beside it."""
    write_tfrecord(tmp_path / "recordings/waymo/training/training.tfrecord-00000-of-01000", [scenario_bytes(1)])
    write_forecasting(tmp_path / "recordings/argoverse2/val", num_scenarios=2, seed=0)
    write_vintages(tmp_path / "recordings/pickles")
    assert run_blocks("README.md", monkeypatch, tmp_path) >= 9


@pytest.mark.long
def test_evaluation_examples_run(monkeypatch, tmp_path):
    assert run_blocks("docs/evaluation.md", monkeypatch, tmp_path) >= 5
    runs = Lake(tmp_path / "lake").ask("runs")
    planner = runs.filter(run="driven-my_planner.Planner-replay-kinematic")
    assert planner["success"].item() > 0.8, "the page's planner follows its route"


@pytest.mark.long
def test_cluster_examples_run(monkeypatch, tmp_path):
    (profile,) = blocks("docs/cluster.md", "toml")
    (tmp_path / "mine.toml").write_text(profile)
    assert run_blocks("docs/cluster.md", monkeypatch, tmp_path) == 2
    assert len(Lake(tmp_path / "lake")) == 192


def test_the_page_of_clusters_is_true():
    """It names every profile, its own is one, and what it lets type can be parsed."""
    page = (ROOT / "docs" / "cluster.md").read_text("utf-8")
    assert [name for name in profiles.names() if f"| `{name}` |" not in page] == []
    (profile,) = blocks("docs/cluster.md", "toml")
    assert profiles.parse(profile, "mine.toml").workers == 2
    lines = [
        line for kind in ("bash", "sh") for block in blocks("docs/cluster.md", kind) for line in block.splitlines()
    ]
    for line in lines:
        program, name, *words = shlex.split(line)
        if program == "scenarionet":
            cli.get_command(None, name).make_context(name, words)


def test_simulator_examples_run(monkeypatch, tmp_path):
    assert run_blocks("docs/simulator.md", monkeypatch, tmp_path) >= 5


def test_simulator_page_names_tests_that_exist():
    """In a row of the table, ``::test_name`` alone is in the file named before it."""
    page, folder = (ROOT / "docs" / "simulator.md").read_text("utf-8"), ROOT / "tests" / "scenarionet_sim"
    assert page.count("::test_") > 20
    for row in page.splitlines():
        where = ""
        for file, name in re.findall(r"`([\w/]+\.py)?(?:::(test_\w+))?`", row.rpartition(" | ")[2]):
            where = file or where
            assert not name or f"def {name}(" in (folder / where).read_text("utf-8"), f"{where}::{name}"
        for part in re.findall(r"`([a-z_]+/)`", row.rpartition(" | ")[2]):
            assert list((folder / part).glob("test_*.py")), part


@pytest.mark.long
def test_examples_of_pictures_run(monkeypatch, tmp_path):
    pytest.importorskip("plotly", reason="the extra `notebooks` is not installed")
    assert run_blocks("docs/pictures.md", monkeypatch, tmp_path) == 4
    written = {path.name for path in tmp_path.iterdir()}
    assert {
        "scenario.svg",
        "speeds.png",
        "two.pdf",
        "eight.png",
        "scenario.gif",
        "explore.html",
        "comparison.svg",
    } <= written


def test_pages_show_pictures_that_are_there():
    """Small ones, none left over; every notebook has its row."""
    page = "".join(path.read_text("utf-8") for path in (ROOT / "README.md", *(ROOT / "docs").glob("*.md")))
    pictures = list((ROOT / "docs" / "pictures").glob("*.png"))
    assert [path.name for path in pictures if f"pictures/{path.name})" not in page] == []
    assert all(path.stat().st_size < 150_000 for path in pictures)
    assert [name for name in notebooks.names() if f"(notebooks/{name}.md)" not in page] == []


@pytest.mark.long
def test_examples_of_looking_run(monkeypatch, tmp_path):
    """The commands that serve a page are parsed: they would go on until Ctrl-C."""
    assert run_blocks("docs/browse.md", monkeypatch, tmp_path) == 1
    assert (tmp_path / "compared.html").stat().st_size > 10_000
    served = [line for block in blocks("docs/browse.md", "sh") for line in block.splitlines() if "browse" in line]
    assert len(served) == 2
    for command in served:
        words = shlex.split(command)[1:]
        cli.get_command(click.Context(cli), words[0]).make_context(words[0], words[1:])


def test_pictures_of_pages_are_there_and_small():
    for page in (ROOT / "docs").glob("*.md"):
        for name in re.findall(r"!\[[^\]]+\]\(([^)]+)\)", page.read_text("utf-8")):
            assert 0 < (page.parent / name).stat().st_size < 150_000, name


@pytest.mark.long
def test_sensor_examples_run(monkeypatch, tmp_path):
    assert run_blocks("docs/sensors.md", monkeypatch, tmp_path) == 3


def test_sensors_page_lists_every_sensor():
    page = (ROOT / "docs" / "sensors.md").read_text("utf-8")
    kinds = [name for name in sensors.__all__ if name not in ("Sensor", "Channel")]
    assert [name for name in kinds if f"| `{name}` |" not in page] == []


def test_evaluation_page_explains_every_metric():
    page = (ROOT / "docs" / "evaluation.md").read_text("utf-8")
    table = tables.load("results")
    explained = {column.name for column in (*table.columns, *table.derived)} - {"run", "scenario_id", "track_id"}
    assert [name for name in sorted(explained) if f"`{name}`" not in page] == []


@pytest.mark.long
def test_examples_of_databases_run(tmp_path, monkeypatch):
    """Every command of the page, in order, in this process, then its Python; warnings are part of the page."""
    monkeypatch.chdir(tmp_path)
    commands = [line for block in blocks("docs/databases.md", "bash") for line in block.splitlines()]
    assert len(commands) >= 25
    with warnings.catch_warnings():
        warnings.simplefilter("default")
        for command in commands:
            program, *words = shlex.split(command)
            assert program == "scenarionet"
            result = CliRunner().invoke(cli, words)
            assert result.exit_code == 0, command + result.output
        (code,) = blocks("docs/databases.md", "python")
        exec(code, {})


@pytest.mark.long
def test_maintenance_examples_run(monkeypatch, tmp_path):
    assert run_blocks("docs/maintenance.md", monkeypatch, tmp_path) == 1


def test_the_page_of_checks_is_true():
    """It lists every rule as its file says and every dataset's budgets; its rule of one's own is one."""
    page = (ROOT / "docs" / "checks.md").read_text("utf-8")
    for check in map(rules.load, rules.names()):
        assert f"| `{check.name}` | {check.kind} | {check.doc} |" in page
    for dataset in converters.names():
        numbers = " | ".join(f"{number:g}" for number in asdict(converters.budgets(dataset)).values())
        assert f"| `{dataset}` | {numbers} |" in page


def test_the_page_of_checks_runs(tmp_path, monkeypatch):
    """Its commands, and its rule beside the others."""
    (rule,) = blocks("docs/checks.md", "sql")
    shutil.copytree(resources.SQL, tmp_path / "sql")
    (tmp_path / rule.splitlines()[0].removeprefix("-- ")).write_text(rule.split("\n", 1)[1])
    monkeypatch.setattr("scenarionet_data.catalog.named_sql.SQL", tmp_path / "sql")
    monkeypatch.chdir(tmp_path)
    lake = write_lake("lake", [make_scenario(1, num_objects=1, num_lanes=1), make_scenario(2, num_lanes=1)])
    lines = [
        line.partition("#")[0].split() for block in blocks("docs/checks.md", "bash") for line in block.splitlines()
    ]
    results = [CliRunner().invoke(cli, line[1:]) for line in lines]
    assert [result.exit_code for result in results] == [0] * 3, results[0].output
    assert "ego_is_alone             1  50.00%  made/v1/s000001: nobody else is there" in results[0].output
    assert pl.read_csv("scorecard.csv").height == len(rules.names())
    assert len(lake.database("good")) == 2
    assert pl.read_parquet("broken.parquet")["scenario_id"].to_list() == [make_scenario(1).id]


def test_readme_names_make_targets_that_exist():
    targets = set(re.findall(r"^([a-z0-9-]+):", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE))
    named = set(re.findall(r"(?:^|`)make ([a-z0-9-]+)", (ROOT / "README.md").read_text("utf-8"), re.MULTILINE))
    assert {"demo", "test"} <= named <= targets


@pytest.mark.long
def test_the_example_converter_passes_its_own_conformance_test(tmp_path):
    """The page's two Python blocks as a module and its test, outside the repository."""
    converter, test = blocks("docs/adding_a_dataset.md", "python")
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
def test_the_example_as_an_installed_package_is_a_dataset_like_every_other(tmp_path):
    """The page's package, built and installed by the page's own commands, into a folder of its own."""
    page = "docs/adding_a_dataset.md"
    package = tmp_path / "my-datasets"
    package.mkdir()
    (package / "my_datasets.py").write_text(blocks(page, "python")[0])
    (package / "pyproject.toml").write_text(blocks(page, "toml")[0])
    (tmp_path / "recordings").mkdir()
    rows = "".join(f"{k / 10},ego,car,{k},0,0,10\n" for k in range(30))
    (tmp_path / "recordings" / "first.csv").write_text("t,id,kind,x,y,heading,speed\n" + rows)
    environment = os.environ | {
        "PYTHONPATH": f"{ROOT}:{tmp_path / 'installed'}",
        "PATH": f"{commands(tmp_path, 'pip=pip', 'scenarionet=pipelines.cli')}:{os.environ['PATH']}",
        # pip's own options: what the package needs is here already, and nothing is downloaded.
        "PIP_TARGET": str(tmp_path / "installed"),
        "PIP_NO_DEPS": "1",
        "PIP_NO_INDEX": "1",
        "PIP_NO_BUILD_ISOLATION": "0",
        "PIP_DISABLE_PIP_VERSION_CHECK": "1",
    }
    (typed,) = blocks(page, "bash")
    asked = (
        "scenarionet converters --json > listed.json\nscenarionet sql lake 'SELECT * FROM metadata' --json > rows.json"
    )
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


@pytest.mark.parametrize("kind", ["derived column", "filter", "check"])
def test_what_the_architecture_page_adds_in_one_place_works(kind, tmp_path):
    """Copies the contract and the SQL, adds the page's example to the copy, and uses it."""
    code = """
import shutil, sys
from pathlib import Path
from scenarionet_data import resources
copy = Path(sys.argv[1])
shutil.copytree(resources.SCHEMAS, copy / "schemas"); shutil.copytree(resources.SQL, copy / "sql")
resources.SCHEMAS, resources.SQL = copy / "schemas", copy / "sql"
kind, text = sys.argv[2], sys.argv[3]
if kind == "derived column":
    with (copy / "schemas/metadata.toml").open("a") as file: file.write(text)
else:
    path = copy / text.splitlines()[0].removeprefix("-- ")
    path.write_text(text.split("\\n", 1)[1])
from scenarionet_data import Lake
from scenarionet_data.conversion import convert
from tests.fixtures.made import NAME, write_raw
raw = write_raw(copy / "raw", {"a": list(range(4))})
convert(NAME, str(raw), copy / "lake")
lake = Lake(copy / "lake")
if kind == "derived column":
    assert (lake.sql("SELECT mean_object_speed_kmh AS v FROM metadata")["v"] > 30).all()
elif kind == "filter":
    assert 0 < len(lake.filter(name="crowded", named=["crowded:per_100m=10"])) <= 4
else:
    from scenarionet_data.catalog.checks import run_checks
    (result,) = [r for r in run_checks(lake) if r.name == "ego_moves_backwards"]
    assert result.doc
"""
    sql = blocks("docs/architecture.md", "sql")
    text = {"derived column": blocks("docs/architecture.md", "toml")[0], "filter": sql[0], "check": sql[1]}[kind]
    done = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path), kind, text],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
