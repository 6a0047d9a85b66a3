"""Damaged tables and GeoJSON maps: a sentence, or a defect for what cannot be used; nothing else is lost."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from scenarionet_data.converters.formats.geojson import read_geojson
from scenarionet_data.converters.table import TrackTable
from scenarionet_data.errors import CorruptSource
from tests.scenarionet_data.converters.damage import DamageConformance, RowDamage
from tests.scenarionet_data.converters.test_table import road_map, rows_of_two, write


class TestTableDamage(DamageConformance):
    converter = TrackTable()
    options = {"window": 60.0}  # noqa: RUF012

    @pytest.fixture
    def raw(self, tmp_path: Path) -> Path:
        rows = rows_of_two(400)
        rows["track"] = [f"{name}{k // 20}" for k, name in enumerate(rows["track"])]
        write(tmp_path / "raw", {name: values[:400] for name, values in rows.items()})
        write(tmp_path / "raw", {name: values[400:] for name, values in rows.items()}, "more.parquet")
        return tmp_path / "raw"

    def damage_rows(self, raw: Path, rng: np.random.Generator) -> RowDamage:
        path = raw / "tracks.csv"
        lines = path.read_text().splitlines()
        hit, added = set(), 0
        for row, column, text in ((30, 3, "nan"), (70, 4, "x"), (110, 1, ""), (150, 5, "1e9"), (190, 8, "-4")):
            cells = lines[row].split(",")
            cells[column] = text
            lines[row] = ",".join(cells)
            hit.add(cells[0].strip('"'))
        lines[230] = lines[230].rpartition(",")[0]
        hit.add(lines[230].split(",")[0].strip('"'))
        lines.append(lines[270])
        hit.add(lines[270].split(",")[0].strip('"'))
        path.write_text("\n".join(lines))
        return RowDamage(frozenset(hit), added + 1)


LANE = {"type": "lane"}
POINTS = [[0, 0], [10, 0]]
BAD_FEATURES = {
    "no mapping": 7,
    "no geometry": {"properties": LANE},
    "unknown type": {"properties": {"type": "rail"}, "geometry": {"type": "LineString", "coordinates": POINTS}},
    "no type": {"geometry": {"type": "LineString", "coordinates": POINTS}},
    "odd shape": {"properties": LANE, "geometry": {"type": "Sphere", "coordinates": POINTS}},
    "text": {"properties": LANE, "geometry": {"type": "LineString", "coordinates": [["a", 0], [1, 0]]}},
    "ragged": {"properties": LANE, "geometry": {"type": "LineString", "coordinates": [[0, 0], [1]]}},
    "one point": {"properties": LANE, "geometry": {"type": "LineString", "coordinates": [[0, 0]]}},
    "four numbers": {"properties": LANE, "geometry": {"type": "LineString", "coordinates": [[0, 0, 0, 0]] * 2}},
    "huge": {"properties": LANE, "geometry": {"type": "LineString", "coordinates": [[0, 0], [10**400, 0]]}},
    "far away": {"properties": LANE, "geometry": {"type": "LineString", "coordinates": [[1e12, 0], [1e12, 1]]}},
    "nothing": {"properties": LANE, "geometry": {"type": "Polygon", "coordinates": []}},
    "nan": {"properties": LANE, "geometry": {"type": "LineString", "coordinates": [[float("nan"), 0], [1, 0]]}},
    "id twice": {"id": "1", "properties": LANE, "geometry": {"type": "LineString", "coordinates": POINTS}},
}


@pytest.mark.parametrize("bad", BAD_FEATURES.values(), ids=BAD_FEATURES)
def test_a_bad_feature_costs_itself(tmp_path: Path, bad: object) -> None:
    path = road_map(tmp_path)
    content = json.loads(path.read_text())
    path.write_text(json.dumps({**content, "features": [*content["features"], bad]}))
    builder = read_geojson(path)
    assert len(builder) == 4
    (defect,) = builder.defects
    assert (defect.table, defect.count) == ("maps", 1) and "expected" in defect.reason


@pytest.mark.parametrize(
    "told",
    [{"width": "wide"}, {"width": -4}, {"speed_limit": 1e300}, {"exit_lanes": "2"}, {"exit_lanes": [None, 2.5, {}]},
     {"entry_lanes": {"a": 1}}, {"left_neighbors": [["1"]]}, {"exit_lanes": ["1", "1", "2"]}, {"width": True}],
)  # fmt: skip
def test_odd_properties_are_left_out(tmp_path: Path, told: dict[str, object]) -> None:
    features = read_geojson(road_map(tmp_path, **told)).build(np.zeros(3))
    assert len(features) == 4 and [*features.ids] == ["1", "2", "3", "4"]


def test_cut_and_odd_files_are_sentences(tmp_path: Path) -> None:
    path = road_map(tmp_path)
    content = path.read_bytes()
    odd = [b"", b"[]", b"{}", b'{"features": {}}', b'{"features": []}', b"[" * 100_000, b"\xff\xfe", b'"text"', b"null"]
    for data in [*odd, *(content[:cut] for cut in range(0, len(content) - 2, 50))]:
        path.write_bytes(data)
        with pytest.raises(CorruptSource, match="expected"):
            read_geojson(path)
