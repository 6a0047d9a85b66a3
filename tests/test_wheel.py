"""The source distribution, the wheel, and a checkout that is not installed.

The environments reuse the packages of this one, so that nothing is downloaded.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import venv
import zipfile
from email import message_from_bytes
from pathlib import Path

import pytest

from scenarionet_data.compiled.shipped import levels_of_host
from scenarionet_data.version import __version__

ROOT = Path(__file__).parents[1]
pytestmark = pytest.mark.packaging
PARTS = ("pipelines", "scenarionet_data", "scenarionet_sim", "schemas", "sql")


def call(*words: str | Path, cwd: Path, code: int = 0) -> str:
    """Run a program with an empty environment; return its standard output."""
    done = subprocess.run(
        [str(word) for word in words], cwd=cwd, env={"PATH": "/usr/bin:/bin", "HOME": str(cwd), "LC_ALL": "C.UTF-8"},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == code, done.stdout + done.stderr
    return done.stdout


def environment(folder: Path) -> Path:
    """Create an environment with the packages of this one but without this project; return its interpreter."""
    venv.create(folder, symlinks=True, with_pip=False)
    (packages,) = folder.glob("lib/python*/site-packages")
    # A folder named in a .pth file is searched, but .pth files in it are not read: no editable install.
    (packages / "installed.pth").write_text(sysconfig.get_paths()["purelib"] + "\n")
    return folder / "bin" / "python"


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the source distribution and the wheel built from it."""
    folder = tmp_path_factory.mktemp("built")
    copy = folder / "checkout"
    names = (*PARTS, "tests", "docs", "Makefile", "README.md", "LICENSE", "build_backend.py", "pyproject.toml")
    for name in names:  # a copy, without outputs of earlier builds
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, copy / name, ignore=shutil.ignore_patterns("__pycache__", "machine_code"))
        else:
            copy.mkdir(exist_ok=True)
            shutil.copy(source, copy)
    build(copy, "-C", "machine-code=no", "--outdir", folder)
    return folder


def build(checkout: Path, *words: str | Path) -> None:
    """Build distributions of a checkout."""
    call(sys.executable, "-m", "build", "--no-isolation", *words, checkout, cwd=checkout.parent)


@pytest.fixture(scope="module")
def installed(built: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An environment with the wheel installed; return its folder of programs."""
    folder = tmp_path_factory.mktemp("installed")
    python = environment(folder)
    (wheel,) = built.glob("*.whl")
    pip = (sys.executable, "-m", "pip", "--python", python, "--disable-pip-version-check", "install")
    call(*pip, "--quiet", "--no-deps", "--no-index", "--ignore-installed", wheel, cwd=folder)
    return python.parent


def test_wheel_contains_three_packages_with_schemas_and_queries(built):
    (wheel,) = built.glob("*.whl")
    names = set(zipfile.ZipFile(wheel).namelist())
    files = (path for part in PARTS[:3] for path in (ROOT / part).rglob("*") if path.is_file())
    expected = {
        path.relative_to(ROOT).as_posix().removeprefix("pipelines/")
        for path in files
        if not {"__pycache__", "machine_code"} & set(path.parts)
    }
    expected |= {f"scenarionet_data/{p.relative_to(ROOT).as_posix()}" for p in (ROOT / "schemas").glob("*.toml")}
    expected |= {f"scenarionet_data/{p.relative_to(ROOT).as_posix()}" for p in (ROOT / "sql").rglob("*.sql")}
    own = {name for name in names if ".dist-info/" not in name}
    assert own == expected
    assert {name.partition("/")[0] for name in own} == {"scenarionet_data", "scenarionet_sim", "scenarionet_pipelines"}


def test_metadata_has_version_author_and_urls(built):
    (wheel,) = built.glob("*.whl")
    archive = zipfile.ZipFile(wheel)
    (name,) = [name for name in archive.namelist() if name.endswith(".dist-info/METADATA")]
    fields = message_from_bytes(archive.read(name))
    assert fields["Version"] == __version__
    assert fields["Author"]
    labels = {url.partition(",")[0] for url in fields.get_all("Project-URL")}
    assert labels == {"Homepage", "Documentation", "Repository", "Changelog", "Issues"}


def test_source_distribution_contains_the_project(built):
    (archive,) = built.glob("*.tar.gz")
    with tarfile.open(archive) as file:
        names = {name.partition("/")[2] for name in file.getnames()}
    assert {"Makefile", "README.md", "LICENSE", "pyproject.toml", "schemas/metadata.toml", "tests/conftest.py"} <= names
    assert {
        "docs/explanation/architecture.md",
        "sql/views/metadata.sql",
        "pipelines/scenarionet_pipelines/cli/__init__.py",
    } <= names


def test_a_wheel_that_pip_builds_carries_machine_code_unless_compiling_fails(built, tmp_path):
    """Nothing of it stays in the checkout."""
    folder, checkout = "scenarionet_data/compiled/machine_code", built / "checkout"
    for kind in ("whole", "failing"):
        if kind == "failing":
            (checkout / "pipelines/scenarionet_pipelines/compiling.py").write_text("raise SystemExit(1)")
        build(checkout, "--wheel", "--outdir", tmp_path / kind)
        (wheel,) = (tmp_path / kind).glob("*.whl")
        found = {Path(name).parts[3] for name in zipfile.ZipFile(wheel).namelist() if name.startswith(folder)}
        levels = [level.cpu for level in levels_of_host()[:1]]
        assert found == (set(levels) if kind == "whole" else set())
        assert not (checkout / folder).exists()


def test_installed_command_works_anywhere(installed, tmp_path):
    scenarionet = installed / "scenarionet"
    where = call(installed / "python", "-c", "import scenarionet_data as s; print(s.__file__)", cwd=tmp_path)
    assert where.startswith(str(installed.parent))
    check_command(scenarionet, cwd=tmp_path)


def test_uninstalled_checkout_works(tmp_path):
    python = environment(tmp_path / "python")
    # Includes the compile cache, because compiling takes seconds, but no temporary files.
    for part in PARTS:
        shutil.copytree(ROOT / part, tmp_path / "checkout" / part, ignore=shutil.ignore_patterns("*.tmp.*"))
    where = call(python, "-c", "import scenarionet_data as s; print(s.__file__)", cwd=tmp_path / "checkout")
    assert where.startswith(str(tmp_path / "checkout"))
    uninstalled = ("env", "PYTHONPATH=.:pipelines", python, "-m", "scenarionet_pipelines.cli")
    check_command(*uninstalled, cwd=tmp_path / "checkout")


def check_command(*scenarionet: str | Path, cwd: Path) -> None:
    """Run converters, a conversion, a query and a filter."""
    listed = json.loads(call(*scenarionet, "info", "converters", "--json", cwd=cwd))
    names = {each["name"] for each in listed["converters"]}
    assert {"pg", "scenarionet", "waymo"} <= names
    (cwd / "tests" / "fixtures").mkdir(parents=True)
    for name in ("gate.py", "made.py", "scenarios.py", "waiting.py"):
        shutil.copy(ROOT / "tests/fixtures" / name, cwd / "tests" / "fixtures")
    (cwd / "raw").mkdir()
    (cwd / "raw" / "a.made").write_text("1\n2\n3")
    (cwd / "raw" / "b.made").write_text("4\n5")
    call(*scenarionet, "convert", "tests.fixtures.made:Made", "raw", "lake", "--workers", "1", cwd=cwd)
    rows = json.loads(call(*scenarionet, "sql", "lake", "summary", "--json", cwd=cwd))["rows"]
    assert rows[0]["scenarios"] == 5
    text = call(*scenarionet, "filter", "lake", "--filter", "object_count:min=1", "--name", "some", cwd=cwd)
    assert text == "some@1: 5 scenarios\n"
