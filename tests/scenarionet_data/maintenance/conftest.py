"""A lake of many small shards, and the invariants that every maintenance operation must keep."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest

from scenarionet_data import Lake, ScenarioLoader, convert
from scenarionet_data.maintenance import fsck
from scenarionet_data.scenario.content_hash import content_hash
from scenarionet_data.storage.write import layouts
from scenarionet_data.storage.write.layouts import Layout
from tests.fixtures import made
from tests.fixtures.made import NAME, MadeOptions, write_raw
from tests.fixtures.scenarios import make_scenario

OPTIONS = MadeOptions(num_objects=2)
SMALL = {"num_steps": 3, "num_lanes": 2, "num_lights": 1}


@pytest.fixture(autouse=True)
def small(monkeypatch):
    """Use small scenarios and an analytics profile whose bins hold only a few of them."""
    monkeypatch.setattr(made, "make_scenario", make_small)
    monkeypatch.setitem(layouts.LAYOUTS, "analytics", Layout("analytics", 3, 8))


@pytest.fixture(scope="session")
def _converted(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("maintained")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(made, "make_scenario", make_small)
        convert_to(write_raw(folder / "raw", {f"s{k}": [10 * k, 10 * k + 1] for k in range(4)}), folder / "lake")
    return folder


@pytest.fixture
def raw(_converted, tmp_path) -> Path:
    """Four recordings of two scenarios each."""
    return Path(shutil.copytree(_converted / "raw", tmp_path / "raw"))


@pytest.fixture
def root(raw, _converted, tmp_path) -> Path:
    """A lake converted from them, one shard per recording."""
    return Path(shutil.copytree(_converted / "lake", tmp_path / "lake"))


def make_small(seed, **how):
    return make_scenario(seed, **how, **SMALL)


def convert_to(raw: Path, root: Path, **how) -> Path:
    convert(NAME, str(raw), root, **({"options": OPTIONS, "check": False} | how))
    return root


def content(lake) -> dict[str, int]:
    """Content hash of every scenario, computed from the loaded arrays."""
    return {scenario.id: content_hash(scenario) for scenario in ScenarioLoader(lake)}


def rows(root: Path) -> dict[str, int]:
    """Number of rows visible to SQL in each table; orphaned rows would raise the count."""
    lake = Lake(root)
    return {
        table: lake.sql(f"SELECT count(*) FROM {table}").item() for table in ("metadata", "tracks", "lights", "maps")
    }


def check_whole(root: Path) -> None:
    """Check that every file is intact, every scenario matches its metadata, and SQL sees no orphaned rows."""
    assert fsck(root, is_deep=True, workers=2).problems == ()
    lake = Lake(root)
    assert content(lake) == dict(lake.sql("SELECT scenario_id, content_hash FROM metadata").rows())
    counted = "SELECT (SELECT count(*) FROM tracks), (SELECT coalesce(sum(tracks_num_rows), 0) FROM metadata)"
    found, said = lake.sql(counted).row(0)
    assert found == said


def age(root: Path, days: float) -> None:
    """Make every file of a lake older."""
    for path in root.rglob("*"):
        state = path.stat()
        if path.is_file():
            os.utime(path, (state.st_atime, state.st_mtime - days * 24 * 3600))
