"""How many functions and files of the project the main flows enter, once caches are warm: paths may not grow again."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from scenarionet_data import Lake, ScenarioLoader, convert
from scenarionet_data.errors import NoSuchSnapshot

PACKAGES = {Path(__file__).parents[1] / name for name in ("scenarionet_data", "scenarionet_sim")}


def filters(root):
    return lambda: Lake(root).filter("num_objects > 1", name="entered")


def converts(root):
    return lambda: convert("pg", "0:2", root.with_name("entered"), version="v1")


def loads(root):
    loader = ScenarioLoader(root)
    return lambda: loader[0]


@pytest.fixture(scope="module")
def root(tmp_path_factory):
    """A generated lake; everything that a process does only once is done."""
    root = tmp_path_factory.mktemp("paths") / "lake"
    convert("pg", "0:2", root, version="v1")
    convert("pg", "0:2", root.with_name("warm"), version="v1")
    ScenarioLoader(Lake(root).filter("true", name="warm").view, "warm")[0]
    return root


def entered(flow):
    """Own functions that a flow enters in this thread, by file and first line; comprehensions are functions before
    Python 3.12."""
    found = set()

    def note(frame, event, _):
        if event == "call" and PACKAGES.intersection(Path(frame.f_code.co_filename).parents):
            found.add((frame.f_code.co_filename, frame.f_code.co_qualname, frame.f_code.co_firstlineno))

    sys.setprofile(note)
    try:
        flow()
    finally:
        sys.setprofile(None)
    return found


@pytest.mark.parametrize(
    ("flow", "num_functions", "num_files"), [(loads, 62, 15), (filters, 84, 19), (converts, 304, 55)]
)
def test_paths_stay_within_their_budget(flow, num_functions, num_files, root):
    found = entered(flow(root))
    assert len(found) <= num_functions, sorted(f"{Path(file).stem}.{name}" for file, name, _ in found)
    assert len({file for file, _, _ in found}) <= num_files


def test_functions_are_counted_once():
    def twice():
        for _ in range(2):
            with pytest.raises(NoSuchSnapshot):
                Lake("/nonexistent")

    assert "LakeView.__init__" in {name for _, name, _ in entered(twice)}
    assert len(entered(twice)) < 20
