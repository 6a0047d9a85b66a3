"""Environments made of requirements files, with packages that are files here."""

from __future__ import annotations

import subprocess
import zipfile
from pathlib import Path

import pytest

from scenarionet_data import Lake, convert
from scenarionet_data.errors import BadParameter, SourceNotFound
from scenarionet_sim import evaluate
from scenarionet_sim.drivers.requirements import made_interpreter

PLANNER = """
import numpy as np
from speeds_of_planners import SPEED
from scenarionet_sim import Planner, Trajectory

class Mine(Planner):
    frame = "ego"
    def act(self, view):
        times = np.arange(1, 41) * view.dt
        return Trajectory(np.column_stack([SPEED * times, 0 * times, 0 * times]), times)
"""


def requirements(folder: Path, speed: float) -> Path:
    """A requirements file with a package whose only number is a speed."""
    wheel = folder / f"speeds_of_planners-{speed}-py3-none-any.whl"
    info = f"speeds_of_planners-{speed}.dist-info"
    with zipfile.ZipFile(wheel, "w") as archive:
        archive.writestr("speeds_of_planners.py", f"SPEED = {speed}\n")
        archive.writestr(f"{info}/METADATA", f"Metadata-Version: 2.1\nName: speeds-of-planners\nVersion: {speed}\n")
        archive.writestr(f"{info}/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n")
        archive.writestr(f"{info}/RECORD", "")
    file = folder / f"requirements-{speed:g}.txt"
    file.write_text(f"--no-index\nspeeds-of-planners @ {wheel.as_uri()}\n")
    return file


def test_an_interpreter_stays_as_it_is():
    assert made_interpreter("") == "" and made_interpreter("/usr/bin/python3") == "/usr/bin/python3"


def test_a_missing_file_is_a_sentence(tmp_path):
    with pytest.raises(SourceNotFound, match="there is no requirements file"):
        made_interpreter(str(tmp_path / "nothing.txt"))


@pytest.mark.integration
@pytest.mark.parametrize(
    "line, said",
    [
        ("no-such-package-of-anybody==1", "No matching distribution found for no-such-package-of-anybody==1"),
        ("numpy ( == 1", r"Invalid requirement: 'numpy \( == 1'"),
    ],
    ids=["missing", "misspelt"],
)
def test_an_environment_that_cannot_be_built_is_a_sentence(tmp_path, monkeypatch, line, said):
    monkeypatch.setenv("SCENARIONET_CACHE", str(tmp_path / "cache"))
    file = tmp_path / "requirements.txt"
    file.write_text(f"--no-index\n{line}\n")
    with pytest.raises(BadParameter, match=rf"requirements\.txt: no environment can be made of it: ERROR: {said}"):
        made_interpreter(str(file))
    assert not [path for path in (tmp_path / "cache").rglob("*") if path.is_file()], "nothing is left"


@pytest.mark.integration
def test_old_and_new_differ_in_what_they_need(tmp_path, monkeypatch):
    monkeypatch.setenv("SCENARIONET_CACHE", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)
    Path("mine.py").write_text(PLANNER)
    convert("pg", "0:2", "lake")
    for name, speed in (("slow", 1.0), ("fast", 5.0)):
        evaluate("lake", policy="mine.py:Mine", python=str(requirements(tmp_path, speed)), name=name, tracker="perfect")
    found = Lake("lake").sql("SELECT run, avg(mean_speed) AS speed FROM results GROUP BY 1 ORDER BY 1")
    assert dict(found.iter_rows()) == {"fast": pytest.approx(5.0, rel=0.2), "slow": pytest.approx(1.0, rel=0.2)}
    slow = made_interpreter("requirements-1.txt")
    made = Path(slow).lstat().st_ctime_ns
    assert made_interpreter("requirements-1.txt") == slow and Path(slow).lstat().st_ctime_ns == made, "made once"
    Path("requirements-1.txt").write_text(Path("requirements-5.txt").read_text())
    assert made_interpreter("requirements-1.txt") == made_interpreter("requirements-5.txt") != slow
    words = [slow, "-c", "import speeds_of_planners as s, numpy; print(s.SPEED)"]
    assert subprocess.run(words, capture_output=True, text=True, check=True).stdout == "1.0\n"
