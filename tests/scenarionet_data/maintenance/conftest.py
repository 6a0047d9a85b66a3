"""A lake of many small shards, and what must stay true of it whatever is done."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from scenarionet_data import Lake, ScenarioLoader, convert
from scenarionet_data.codec.content_hash import content_hash
from scenarionet_data.maintenance import fsck
from scenarionet_data.store import profiles
from scenarionet_data.store.profiles import Profile
from tests.fixtures import made
from tests.fixtures.made import NAME, MadeOptions, write_raw
from tests.fixtures.scenarios import make_scenario

OPTIONS = MadeOptions(num_objects=2)
SMALL = {"num_steps": 3, "num_lanes": 2, "num_lights": 1}


@pytest.fixture(autouse=True)
def small(monkeypatch):
    """Small scenarios; an analytics profile that a few of them fill."""
    monkeypatch.setattr(made, "make_scenario", lambda seed, **how: make_scenario(seed, **how, **SMALL))
    monkeypatch.setitem(profiles.PROFILES, "analytics", Profile("analytics", 3, 8))


@pytest.fixture
def raw(tmp_path):
    return write_raw(tmp_path / "raw", {f"s{k}": [10 * k, 10 * k + 1] for k in range(4)})


@pytest.fixture
def root(raw, tmp_path):
    return convert_to(raw, tmp_path / "lake")


def convert_to(raw: Path, root: Path, **how) -> Path:
    convert(NAME, str(raw), root, **({"options": OPTIONS} | how))
    return root


def content(lake) -> dict[str, int]:
    """Content hash of every scenario, computed from what the loader gives."""
    return {scenario.id: content_hash(scenario) for scenario in ScenarioLoader(lake)}


def rows(root: Path) -> dict[str, int]:
    """Rows of each table that SQL sees: rows of nobody would be too many."""
    lake = Lake(root)
    return {
        table: lake.sql(f"SELECT count(*) FROM {table}").item() for table in ("metadata", "tracks", "lights", "maps")
    }


def check_whole(root: Path) -> None:
    """Nothing is wrong with any file, and every scenario is what its metadata say."""
    found = fsck(root, is_deep=True, workers=2)
    assert found.problems == ()
    lake = Lake(root)
    stored = dict(lake.sql("SELECT scenario_id, content_hash FROM metadata").rows())
    assert content(lake) == stored
    assert rows(root)["tracks"] == lake.sql("SELECT sum(tracks_num_rows) FROM metadata").item()


def age(root: Path, days: float) -> None:
    """Make every file of a lake older."""
    for path in root.rglob("*"):
        state = path.stat()
        if path.is_file():
            os.utime(path, (state.st_atime, state.st_mtime - days * 24 * 3600))
