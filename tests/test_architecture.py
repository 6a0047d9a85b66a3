"""The import direction, the folder layout, and that the page that draws them is true."""

from __future__ import annotations

import ast
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("scenarionet_data", "scenarionet_sim", "pipelines")
TOP = {
    "pyproject.toml", "Makefile", "README.md", "LICENSE", ".gitignore", "docs", "pipelines", "scenarionet_data",
    "scenarionet_sim", "schemas", "sql", "tests", ".ci",
}  # fmt: skip
ALSO_ALLOWED = {"CHANGELOG.md", "CONTRIBUTING.md", "CITATION.cff", "SECURITY.md", "mkdocs.yml", ".github"}
FORBIDDEN_WORDS = ("utils", "helpers", "common", "manager", "misc")


def modules(package: str) -> list[Path]:
    return sorted((ROOT / package).rglob("*.py"))


def imported(path: Path) -> set[str]:
    """Every module a file imports, anywhere in it, with the names taken from it."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
    return found


def reaches(path: Path, *forbidden: str) -> list[str]:
    return [f"{path.relative_to(ROOT)} imports {name}" for name in sorted(imported(path))
            if any(name == f or name.startswith(f + ".") for f in forbidden)]  # fmt: skip


def test_imports_go_one_way():
    wrong = []
    for path in modules("scenarionet_data"):
        wrong += reaches(
            path, "scenarionet_sim", "pipelines", "click", "rich", "dask", "pybullet", "gymnasium", "tests"
        )
    for path in modules("scenarionet_sim"):
        wrong += reaches(path, "pipelines", "tests")
    for path in modules("pipelines"):
        wrong += reaches(path, "tests")
    assert wrong == []


def test_converters_know_nothing_of_the_lake():
    above = (
        "schema", "codec", "storage", "databases", "query", "operations", "loader", "quality", "packs", "export",
        "maintenance", "execution", "conversion", "lake", "plots", "display",
    )  # fmt: skip
    lake = [f"scenarionet_data.{name}" for name in above]
    sources = [*modules("scenarionet_data/converters"), *modules("scenarionet_data/procedural")]
    assert [line for path in sources for line in reaches(path, *lake)] == []


def test_no_converter_needs_a_devkit():
    devkits = ("tensorflow", "waymo_open_dataset", "av2", "nuscenes", "nuplan", "l5kit", "metadrive", "argoverse")
    assert [line for path in modules("scenarionet_data") for line in reaches(path, *devkits)] == []


def test_duckdb_stays_behind_the_engine():
    users = {str(path.relative_to(ROOT)) for path in modules("scenarionet_data") if reaches(path, "duckdb")}
    assert users == {f"scenarionet_data/query/{name}.py" for name in ("engine", "statements", "views")}


def test_top_level_is_as_described():
    tracked = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False)
    if tracked.returncode:
        pytest.skip("not a git checkout: the top level cannot be told from what was built in it")
    assert {name.split("/")[0] for name in tracked.stdout.split()} - ALSO_ALLOWED == TOP


@pytest.mark.parametrize("package", PACKAGES)
def test_modules_are_named_for_what_they_are(package):
    names = {part for path in modules(package) for part in path.relative_to(ROOT).with_suffix("").parts}
    assert names.isdisjoint(FORBIDDEN_WORDS)


def test_the_page_names_every_room():
    page = (ROOT / "docs" / "explanation" / "architecture.md").read_text("utf-8")
    rooms = {path.relative_to(ROOT / "scenarionet_data").parts[0] for path in modules("scenarionet_data")}
    missing = [room for room in sorted(rooms) if not room.startswith("__") and room not in page]
    assert missing == []
    simulator = {path.relative_to(ROOT / "scenarionet_sim").parts[0] for path in modules("scenarionet_sim")}
    assert [room for room in sorted(simulator) if not room.startswith("__") and room not in page] == []
    questions = {path.name for path in (ROOT / "sql").iterdir() if path.is_dir()}
    assert [name for name in questions if f"{name}/" not in page] == []


def test_nothing_speaks_of_where_it_was_made():
    """No path of a particular machine, and no folder beside the checkout but in the CI script."""
    words = ("/" + "work/", "../" + "shared", "/" + "root/")
    files = [path for folder in (*PACKAGES, "tests", "docs", "schemas", "sql") for path in (ROOT / folder).rglob("*")]
    files += [ROOT / "README.md", ROOT / "Makefile", ROOT / "pyproject.toml"]
    for path in files:
        if path.suffix in {".py", ".md", ".toml", ".sql", ".json", ""} and path.is_file():
            text = path.read_text("utf-8", errors="ignore")
            assert not [word for word in words if word in text], path
