"""Two lakes for database operations: recordings of many logs, and a lake whose scenarios have changed."""

from __future__ import annotations

import shutil
from dataclasses import replace

import pytest

from scenarionet_data import Lake, convert
from tests.fixtures.lakes import write_lake
from tests.fixtures.made import NAME, MadeOptions, write_raw
from tests.fixtures.scenarios import make_scenario, renamed

COUNT = 120


def recording(template, number):
    """Scenario ``number``; four scenarios per log, windows of 3 s that start every 2 s; the last ten have no log."""
    log = f"log{number // 4:02d}" if number < COUNT - 10 else None
    city = ("austin", "boston", "boston", "las vegas")[number // 4 % 4]
    named = renamed(template, f"s{number:03d}")
    date = f"2021-05-{1 + number // 10:02d}"
    source = replace(named.source, scenario_id=f"r{number:03d}", log=log, city=city, date=date)
    extras = {"start_timestamp_us": 1_600_000_000_000_000 + 2_000_000 * (number % 4)}
    return replace(named, source=source, extras=extras)


@pytest.fixture(scope="package")
def _logs(tmp_path_factory):
    small = {"num_steps": 31, "num_lanes": 0, "num_lights": 0, "has_map": False}
    templates = [make_scenario(k, num_objects=1 + k, **small) for k in range(6)]
    made = [recording(templates[number % 6], number) for number in range(COUNT)]
    return write_lake(tmp_path_factory.mktemp("logs"), made).root


@pytest.fixture
def logs(_logs, tmp_path):
    """A private copy of the lake: 120 scenarios of 28 logs, 4 cities (one with a space), 12 days."""
    return Lake(shutil.copytree(_logs, tmp_path / "lake"))


@pytest.fixture(scope="package")
def _changed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("changed")
    raw, root = write_raw(folder / "raw", {"a": [1, 2], "b": [3]}), folder / "lake"
    convert(NAME, str(raw), root, options=MadeOptions(num_objects=2))
    Lake(root).filter("true", name="old")
    Lake(root).filter("num_objects > 0", name="child", database="old")
    Lake(root).filter("ends_with(scenario_id, '3')", name="same")
    (raw / "a.made").write_text("1\n4")
    (raw / "b.made").unlink()
    convert(NAME, str(raw), root, options=MadeOptions(num_objects=3), replace=True)
    return root


@pytest.fixture
def changed(_changed, tmp_path):
    """A lake where scenario 1 changed, 2 was removed and 4 was added after databases old, child and same were saved."""
    return Lake(shutil.copytree(_changed, tmp_path / "lake"))
