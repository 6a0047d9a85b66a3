"""What the documentation shows is true: its code runs, its tables are up to date."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from scenarionet_data import Lake, dictionary, tables
from tests.fixtures.argoverse2 import write_forecasting
from tests.fixtures.scenarionet_pickles import write_vintages
from tests.fixtures.waymo import scenario_bytes, write_tfrecord

ROOT = Path(__file__).parents[1]


def blocks(page: str, language: str) -> list[str]:
    """Fenced code blocks of a page."""
    text = (ROOT / page).read_text("utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


def test_data_dictionary_is_up_to_date():
    written = (ROOT / "docs" / "data_dictionary.md").read_text("utf-8")
    assert written == dictionary.markdown(), "run `make docs`"
    readme = (ROOT / "README.md").read_text("utf-8")
    assert readme == dictionary.into_page(readme), "run `make docs`"


def run_blocks(page: str, folder: Path) -> int:
    """Run every bash and python block of a page, in order, in one folder; returns how many there are.

    A python block whose first line names a file is written there instead.
    """
    command = folder / "bin" / "scenarionet"
    command.parent.mkdir()
    command.write_text(f'#!/bin/sh\nexec {sys.executable} -m pipelines.cli "$@"\n')
    command.chmod(0o755)
    environment = os.environ | {"PYTHONPATH": str(ROOT), "PATH": f"{command.parent}:{os.environ['PATH']}"}
    text = (ROOT / page).read_text("utf-8")
    found = re.findall(r"^```(bash|python)\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    for language, code in found:
        name = re.match(r"# (\w+\.py)\n", code)
        if name:
            (folder / name.group(1)).write_text(code)
            continue
        runner = ["bash", "-euo", "pipefail", "-c"] if language == "bash" else [sys.executable, "-c"]
        done = subprocess.run([*runner, code], cwd=folder, env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 0, code + done.stdout + done.stderr
    return len(found)


def test_readme_examples_run(tmp_path):
    """With recordings beside it."""
    write_tfrecord(tmp_path / "recordings/waymo/training/training.tfrecord-00000-of-01000", [scenario_bytes(1)])
    write_forecasting(tmp_path / "recordings/argoverse2/val", num_scenarios=2, seed=0)
    write_vintages(tmp_path / "recordings/pickles")
    assert run_blocks("README.md", tmp_path) >= 9


@pytest.mark.long
def test_evaluation_examples_run(tmp_path):
    assert run_blocks("docs/evaluation.md", tmp_path) >= 5
    runs = Lake(tmp_path / "lake").ask("runs")
    planner = runs.filter(run="driven-my_planner.Planner-replay-kinematic")
    assert planner["success"].item() > 0.8, "the page's planner follows its route"


def test_simulator_examples_run(tmp_path):
    assert run_blocks("docs/simulator.md", tmp_path) >= 5


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


def test_evaluation_page_explains_every_metric():
    page = (ROOT / "docs" / "evaluation.md").read_text("utf-8")
    table = tables.load("results")
    explained = {column.name for column in (*table.columns, *table.derived)} - {"run", "scenario_id", "track_id"}
    assert [name for name in sorted(explained) if f"`{name}`" not in page] == []


def test_readme_names_make_targets_that_exist():
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE))
    named = set(re.findall(r"(?:^|`)make ([a-z-]+)", (ROOT / "README.md").read_text("utf-8"), re.MULTILINE))
    assert {"demo", "test"} <= named <= targets


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
