"""Lakes that earlier versions wrote are read as they were then; see ``tests/golden/lakes/README.md``."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from scenarionet_data.maintenance.fsck import fsck
from scenarionet_data.storage.integrity import seals
from tests.fixtures.golden_lakes import describe

pytestmark = pytest.mark.integration

LAKES = Path(__file__).parents[1] / "golden" / "lakes"
EXPECTED = sorted(LAKES.glob("format-*/*/expected.json"))


def test_there_are_lakes_of_every_format():
    assert ["/".join(path.parts[-3:-1]) for path in EXPECTED] == [
        "format-1/generated",
        "format-1/packed",
        "format-1/recorded",
        "format-2/generated",
        "format-3/generated",
    ]
    written = json.loads((EXPECTED[-1].parent / "lake" / "snapshots" / "00000001.json").read_text())
    assert written["format"] == seals.FORMAT  # a new format gets a folder of its own


@pytest.mark.parametrize("path", EXPECTED, ids=lambda path: f"{path.parts[-3]}-{path.parts[-2]}")
def test_a_lake_is_whole(path: Path):
    found = fsck(path.parent / "lake", is_deep=True)
    assert found.problems == ()
    assert bool(found.unsealed) == ("format-3" not in path.parts)


@pytest.mark.parametrize("path", EXPECTED, ids=lambda path: f"{path.parts[-3]}-{path.parts[-2]}")
def test_a_lake_says_what_it_said(path: Path, tmp_path: Path):
    expected = json.loads(path.read_text())
    root = Path(shutil.copytree(path.parent / "lake", tmp_path / "lake"))
    found = json.loads(json.dumps(describe(root, **expected["asked"]), default=str))
    assert _differences(expected["said"], found, "") == []


REDEFINED = "/views/metadata/columns/duration/sum"
"""A derived column that has another definition since, as the changelog says."""


RENAMED = {"is_time_to_collision_long": "is_time_to_collision_in_bound"}
"""Derived columns that have another name since, as the changelog says."""


def _differences(expected: Any, found: Any, place: str) -> list[str]:
    """Where a description says other than expected; it may say more, for example of a column that is new."""
    if isinstance(expected, dict) and isinstance(found, dict):
        expected = {RENAMED.get(key, key) if key not in found else key: value for key, value in expected.items()}
        there = [key for key in expected if key in found]
        missing = [f"{place}/{key}: missing" for key in expected if key not in found]
        return missing + [d for key in there for d in _differences(expected[key], found[key], f"{place}/{key}")]
    if isinstance(expected, list) and isinstance(found, list) and len(expected) == len(found):
        pairs = enumerate(zip(expected, found, strict=True))
        return [d for number, (one, other) in pairs for d in _differences(one, other, f"{place}/{number}")]
    is_near = expected == found or place == REDEFINED
    if not is_near and isinstance(expected, float) and isinstance(found, (int, float)):
        is_near = found == pytest.approx(expected, rel=1e-9, abs=1e-6)  # computed in SQL
    return [] if is_near else [f"{place}: wanted {expected!r}, found {found!r}"]
