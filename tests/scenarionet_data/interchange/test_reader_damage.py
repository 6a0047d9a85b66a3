"""Damaged files of GPUDrive and PufferDrive: a bad state, object or road costs itself, a bad file its scenario."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from scenarionet_data import Lake
from scenarionet_data.errors import InvalidScenario
from scenarionet_data.interchange import writer_for
from scenarionet_data.interchange.base import Losses
from scenarionet_data.interchange.gpudrive.reader import GpuDrive
from scenarionet_data.interchange.pufferdrive.layout import decode, encode
from scenarionet_data.interchange.pufferdrive.reader import PufferDrive
from tests.fixtures.reading import scenarios
from tests.scenarionet_data.converters.damage import DamageConformance, RowDamage


def write(lake: Path, folder: Path, name: str) -> Path:
    folder.mkdir()
    for number, scenario in enumerate(Lake(lake).loader()[:2]):
        for file, content in writer_for(name).write(scenario, f"scene{number}", Losses()).items():
            (folder / file).write_bytes(content)
    return folder


class TestGpuDriveDamage(DamageConformance):
    converter = GpuDrive()

    @pytest.fixture
    def raw(self, lake: Path, tmp_path: Path) -> Path:
        return write(lake, tmp_path / "raw", "gpudrive")

    def damage_rows(self, raw: Path, rng: np.random.Generator) -> RowDamage:
        hit = set()
        for path in sorted(raw.iterdir()):
            content = json.loads(path.read_bytes())
            ego = content["metadata"]["sdc_track_index"]
            others = [each for row, each in enumerate(content["objects"]) if row != ego and sum(each["valid"]) > 3]
            for each, (name, value) in zip(
                others,
                (
                    ("heading", float("inf")),
                    ("position", {"x": float("nan"), "y": 0, "z": 0}),
                    ("velocity", {"x": 1e9, "y": 0}),
                ),
                strict=False,
            ):
                each[name][each["valid"].index(True) + 1] = value
                hit.add(f"{path.stem} {each['id']}")
            path.write_text(json.dumps(content))
        return RowDamage(frozenset(hit))


class TestPufferDriveDamage(DamageConformance):
    converter = PufferDrive()

    @pytest.fixture
    def raw(self, lake: Path, tmp_path: Path) -> Path:
        return write(lake, tmp_path / "raw", "pufferdrive")

    def damage_rows(self, raw: Path, rng: np.random.Generator) -> RowDamage:
        hit = set()
        for path in sorted(raw.iterdir()):
            puffer_map = decode(path.read_bytes(), 2, path.name)
            for row, each in enumerate(puffer_map.objects):
                if row != puffer_map.ego and each.valid.sum() > 3 and len(hit) < 6:
                    heading = each.heading.copy()
                    heading[int(each.valid.argmax())] = np.nan
                    puffer_map.objects[row] = type(each)(**{**vars(each), "heading": heading})
                    hit.add(f"{path.stem} {each.id}")
            path.write_bytes(encode(puffer_map, 2))
        return RowDamage(frozenset(hit))


OBJECT = {
    "position": [{"x": float(k), "y": 0.0} for k in range(91)],
    "velocity": [{"x": 10.0, "y": 0.0}] * 91,
    "heading": [0.0] * 91,
    "valid": [True] * 91,
    "length": 4.0, "width": 2.0, "height": 1.5, "type": "vehicle", "id": 1,
}  # fmt: skip
ROAD = {"type": "lane", "id": 5, "map_element_id": 2, "geometry": [{"x": 0, "y": 0}, {"x": 9, "y": 0}]}


def scene(folder: Path, objects: list[object], roads: list[object], **more: object) -> Path:
    content = {"objects": objects, "roads": roads, "metadata": {"sdc_track_index": 0}, **more}
    (folder / "a.json").write_text(json.dumps(content))
    return folder


@pytest.mark.parametrize(
    "bad",
    [7, None, [], {}, {"position": 3}, {"valid": [True] * 90}, {"heading": ["north"] * 91}, {"type": "tram"},
     {"position": [{}] * 91}, {"position": [None] * 91}, {"length": "long"}, {"length": 0.0}, {"id": 1},
     {"heading": [10**400] * 91}, {"velocity": [{"x": True, "y": 0}] * 91}],
)  # fmt: skip
def test_a_bad_object_costs_itself(tmp_path: Path, bad: object) -> None:
    other = {**OBJECT, "id": 2, **bad} if isinstance(bad, dict) and bad else bad
    (scenario,) = scenarios(GpuDrive(), scene(tmp_path, [OBJECT, other], [ROAD]))
    assert [*scenario.tracks.ids] == ["1"] and len(scenario.map) == 1
    assert scenario.defects and all("expected" in defect.reason for defect in scenario.defects)


@pytest.mark.parametrize(
    "bad",
    [7, None, {}, {"geometry": 3}, {"geometry": []}, {"geometry": [{"x": "a", "y": 0}]}, {"map_element_id": 99},
     {"geometry": [{"x": float("nan"), "y": 0}] * 2}, {"geometry": [{"x": 1e12, "y": 0}] * 2}],
)  # fmt: skip
def test_a_bad_road_costs_itself(tmp_path: Path, bad: object) -> None:
    other = {**ROAD, "id": 6, **bad} if isinstance(bad, dict) and bad else bad
    (scenario,) = scenarios(GpuDrive(), scene(tmp_path, [OBJECT], [ROAD, ROAD | {"id": 7}, other]))
    assert [*scenario.map.ids] == ["5", "7"]
    assert [(defect.table, defect.count) for defect in scenario.defects] == [("maps", 1)]


@pytest.mark.parametrize(
    "more",
    [{"metadata": 3}, {"metadata": {"sdc_track_index": 99}}, {"metadata": {"sdc_track_index": "first"}},
     {"tl_states": {"5": {}}}, {"tl_states": {"5": {"state": ["go"] * 91, "x": [], "y": [], "z": []}}},
     {"tl_states": 3},
     {"metadata": {"sdc_track_index": 0, "tracks_to_predict": [3, {"track_index": 9}], "objects_of_interest": [8]}}],
)  # fmt: skip
def test_odd_metadata_is_left_out(tmp_path: Path, more: dict[str, object]) -> None:
    (scenario,) = scenarios(GpuDrive(), scene(tmp_path, [OBJECT], [ROAD], **more))
    assert scenario.ego_id == "1" and scenario.tracks_to_predict == scenario.objects_of_interest == ()


@pytest.mark.parametrize("content", [b"", b"[]", b'{"objects": 3, "roads": []}', b"[" * 100_000, b"\xff"])
def test_what_is_no_scenario_is_a_sentence(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.json").write_bytes(content)
    (tmp_path / "a.bin").write_bytes(content)
    for converter in (GpuDrive(), PufferDrive()):
        with pytest.raises(InvalidScenario, match="expected"):
            scenarios(converter, tmp_path)
