"""Trials with damaged nuScenes tables: rows damaged in realistic ways, and files damaged in any way."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scenarionet_data.converters.nuscenes import NuScenes, NuScenesOptions
from scenarionet_data.errors import InvalidScenario
from scenarionet_data.storage.write.shard_writer import check_share_of_bad_rows
from tests.fixtures import nuscenes as fixture
from tests.fixtures.reading import scenarios
from tests.scenarionet_data.converters.damage import DamageConformance, RowDamage

ROWS: tuple[Callable[[dict[str, Any]], object], ...] = (
    lambda row: row.update(translation=[float("nan"), 1.0, 2.0]),
    lambda row: row.update(translation=None),
    lambda row: row.update(translation=["12.5", 1.0, 2.0]),
    lambda row: row.update(translation=[1e12, 1.0, 2.0]),
    lambda row: row.update(size=[1.0, 0.0, 2.0]),
    lambda row: row.update(size=[1e9, 1.0, 2.0]),
    lambda row: row.update(rotation=[0.0, 0.0, 0.0, 0.0]),
    lambda row: row.update(instance_token="f" * 32),
    lambda row: row.pop("sample_token"),
)
"""Damages of rows of ``sample_annotation``."""


class TestNuScenesDamage(DamageConformance):
    converter = NuScenes()
    split = "mini"
    options = {"frames": "recorded"}  # noqa: RUF012  # each state is a row

    @pytest.fixture(scope="class")
    @classmethod
    def raw(cls, tmp_path_factory: pytest.TempPathFactory) -> Path:
        root = tmp_path_factory.mktemp("nuscenes")
        scenes = fixture.write_invented(root, num_scenes=2, num_keyframes=25)
        fixture.write_can_bus(root, scenes[0])
        return root

    def damage_rows(self, raw: Path, rng: np.random.Generator) -> RowDamage:
        path = raw / "v1.0-mini" / "sample_annotation.json"
        rows = json.loads(path.read_text())
        chosen = rng.choice(len(rows), max(len(rows) // 100, len(ROWS)), replace=False)
        hit = {rows[number]["instance_token"] for number in chosen}
        for count, number in enumerate(chosen):
            ROWS[count % len(ROWS)](rows[number])
        rows.insert(int(chosen[-1]), rows[0])
        path.write_text(fixture.to_json(rows))
        return RowDamage(frozenset(hit | {rows[0]["instance_token"]}), num_added=1)


@pytest.mark.long
@pytest.mark.parametrize("frames", ["recorded", "resampled"])
@pytest.mark.parametrize(("share", "is_kept"), [(0.15, True), (0.45, False)])
def test_share_of_bad_rows_is_one_of_recorded_rows(tmp_path: Path, frames: str, share: float, is_kept: bool) -> None:
    """Interpolated states, four of five after resampling, do not count."""
    fixture.write_invented(tmp_path, num_scenes=1, num_keyframes=9)
    path = tmp_path / "v1.0-mini" / "sample_annotation.json"
    rows = json.loads(path.read_text())
    for number, row in enumerate(rows):
        if number < share * len(rows):
            row["size"] = [0.0, 0.0, 0.0]
    path.write_text(json.dumps(rows))
    (scenario,) = scenarios(NuScenes(), tmp_path, "mini", frames=frames)
    num_dropped = sum(defect.count for defect in scenario.defects if defect.field == "size")
    assert num_dropped == np.ceil(share * len(rows))
    with nullcontext() if is_kept else pytest.raises(InvalidScenario, match="expected at most 20% unusable rows"):
        check_share_of_bad_rows(scenario, NuScenesOptions().max_bad_rows)
