"""Every notebook runs, on generated scenarios and on real recordings; committed notebooks have no outputs."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from scenarionet_data import Lake, convert, converters
from scenarionet_pipelines.notebooks import names, path
from tests.fixtures.lakes import write_lake
from tests.fixtures.scenarios import make_scenario

pytest.importorskip("nbclient", reason="the extra `notebooks` is not installed")

from scenarionet_pipelines.notebooks.execution import execute, make_example_lake, read, strip
from scenarionet_pipelines.notebooks.rendering import render

pytestmark = pytest.mark.integration

PAGES = Path(__file__).parents[2] / "docs" / "notebooks"
RECORDINGS = os.environ.get("SCENARIONET_TEST_DATA")
REAL = {
    "waymo": "waymo/training",
    "argoverse2": "argoverse2/motion-forecasting/val",
    "scenarionet": "scenarionet",
}


def test_all_notebooks_are_known():
    assert names() == [
        "closed_loop", "cross_dataset", "events", "filters_and_splits", "forecasting", "learning", "moments",
        "overview", "quality", "testing", "three_engines", "your_own_dataset",
    ]  # fmt: skip


@pytest.mark.parametrize("name", names())
def test_outputs_are_stripped(name):
    """As `strip` leaves it, except for spaces; the documentation page shows the outputs."""
    content = json.loads(path(name).read_text("utf-8"))
    for cell in content["cells"]:
        assert cell.get("outputs", []) == []
        assert cell.get("execution_count") is None
        assert set(cell["metadata"]) <= {"tags"}
    notebook = read(name)
    assert strip(read(name)) == notebook


@pytest.mark.parametrize("name", names())
def test_page_matches_its_notebook(name):
    """Every cell is on the page, every picture it shows exists, and no picture is unused."""
    page = (PAGES / f"{name}.md").read_text("utf-8")
    for cell in read(name).cells:
        assert cell.source in page, "run `make notebooks`"
    pictures = {file.name for file in PAGES.glob(f"{name}-*.*")}
    assert all(picture in page for picture in pictures)
    assert page.count("![") == len(pictures)
    for picture in pictures:
        assert (PAGES / picture).stat().st_size < (400_000 if picture.endswith(".webp") else 150_000), picture


def test_overview_notebook_runs(tmp_path, monkeypatch):
    """Its cells in this process, without a kernel, as a quick test."""
    write_lake(tmp_path / "lake", [make_scenario(number) for number in range(3)])
    monkeypatch.chdir(tmp_path)
    known: dict[str, object] = {}
    for cell in read("overview").cells:
        if cell.cell_type == "code":
            exec(cell.source, known)
    assert len(known["hardest"]) == 3


@pytest.fixture(scope="module")
def generated(tmp_path_factory):
    folder = tmp_path_factory.mktemp("notebooks")
    make_example_lake(folder, 16)
    return folder


def _html(notebook):
    """HTML in the outputs of a notebook."""
    return [
        output["data"]["text/html"]
        for cell in notebook.cells
        for output in cell.get("outputs", [])
        if "text/html" in output.get("data", {})
    ]


@pytest.mark.long
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.learn] if name == "learning" else []) for name in names()]
)
def test_notebooks_run_on_generated_scenarios(name, generated, tmp_path):
    ran = execute(name, generated)
    assert all(cell.execution_count for cell in ran.cells if cell.cell_type == "code")
    page = render(ran, name, tmp_path / "pages", generated).read_text("utf-8")
    assert str(generated) not in page
    assert "Traceback" not in page
    shown = {kind for cell in ran.cells for output in cell.get("outputs", []) for kind in output.get("data", {})}
    assert shown <= {"text/plain", "text/html", "image/png"}, "an export to HTML shows the rest only with JavaScript"
    assert "<script" not in "".join(_html(ran))


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    if not RECORDINGS:
        pytest.skip("real recordings: set SCENARIONET_TEST_DATA to their folder")
    folder = tmp_path_factory.mktemp("recorded")
    for dataset, place in REAL.items():
        if (Path(RECORDINGS) / place).exists():
            convert(dataset, str(Path(RECORDINGS) / place), folder / "lake", split="train")
    assert len(Lake(folder / "lake")) > 10
    return folder


@pytest.mark.long
@pytest.mark.parametrize("name", [name for name in names() if name not in ("learning", "your_own_dataset")])
def test_notebooks_run_on_recordings(name, recorded):
    ran = execute(name, recorded)
    assert all(cell.execution_count for cell in ran.cells if cell.cell_type == "code")


@pytest.mark.long
@pytest.mark.parametrize("name", ["overview", "filters_and_splits", "events", "cross_dataset", "quality"])
def test_notebooks_run_on_a_lake_of_one(name, tmp_path):
    convert("pg", "7:8", tmp_path / "lake")
    execute(name, tmp_path)


def test_converter_template_matches_the_documentation():
    """The converter in the notebook is the documentation's, whose conformance another test checks."""
    page = (PAGES.parent / "guides" / "adding_a_dataset.md").read_text("utf-8")
    (cell,) = [cell.source for cell in read("your_own_dataset").cells if cell.source.startswith("%%writefile")]
    assert cell.split("\n", 1)[1].strip() in page
    assert "CsvTrajectories" not in converters.names()
