"""Tutorials name what they need in their first line, and say how to install it where it is missing."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib

import pytest

from tests.fixtures.examples import ROOT, blocks

TUTORIALS = sorted((ROOT / "docs" / "tutorials").glob("*.md"))
EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]


@pytest.mark.parametrize("page", TUTORIALS, ids=lambda page: page.stem)
def test_first_line_names_the_extra(page):
    first = page.read_text("utf-8").split("\n\n")[1]
    name = re.match(r"Needs the extra `(\w+)`", first)[1]
    assert name in EXTRAS
    installed = re.search(r"scenarionet-lake\[(.*?)\]", " ".join(EXTRAS["dev"]))[1].split(",")
    assert ("`make install` has it" in first) == (name in installed)
    assert ("`make install` leaves out" in first) == (name not in installed)


def test_messages_name_extras_that_exist():
    source = "".join(
        file.read_text("utf-8")
        for part in ("scenarionet_data", "scenarionet_sim", "pipelines")
        for file in (ROOT / part).rglob("*.py")
    )
    named = set(re.findall(r'(?:MissingDependency|needing)\(\s*f?"[^"]*",\s*"(\w+)"', source))
    assert len(named) > 8
    assert named <= EXTRAS.keys()


@pytest.mark.integration
@pytest.mark.parametrize("program", ["camera_driver", "driving_pictures", "forecaster_experiment", "lane_pose"])
def test_examples_say_how_to_install_torch(program):
    folder = ROOT / "docs" / "examples"
    check_first_error((folder / f"{program}.py").read_text("utf-8"), folder)


@pytest.mark.integration
def test_code_of_a_tutorial_says_how_to_install_torch(tmp_path):
    check_first_error(blocks("docs/tutorials/train_a_forecaster.md", "py")[0], tmp_path)


def check_first_error(program, folder):
    without = "import sys\nsys.modules['torch'] = None\nsys.path.insert(0, '.')\n"
    words = [sys.executable, "-c", without + program.replace("from __future__ import annotations\n", "")]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
    assert "need torch: pip install 'scenarionet-lake[learn]'" in done.stderr.splitlines()[-1], done.stderr
