"""Lyft recordings with damaged rows, maps and files."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest

from scenarionet_data.conversion import convert
from scenarionet_data.converters.formats.zarr2 import ChunkedTable
from scenarionet_data.converters.lyft import Lyft
from scenarionet_data.converters.lyft.map_features import read_city
from scenarionet_data.errors import CorruptSource
from tests.fixtures import lyft as fixture
from tests.fixtures import lyft_world as world
from tests.scenarionet_data.converters.damage import DamageConformance, RowDamage, damage_file, damage_json


class TestLyftDamage(DamageConformance):
    converter = Lyft()

    @pytest.fixture(scope="class")
    @classmethod
    def raw(cls, tmp_path_factory: pytest.TempPathFactory) -> Path:
        return fixture.write_dataset(tmp_path_factory.mktemp("raw") / "lyft", num_scenes=2, num_frames=30)

    def damage_rows(self, raw: Path, rng: np.random.Generator) -> RowDamage:
        path = raw / "scenes" / "sample.zarr"
        tables = read_tables(path)
        agents = tables["agents"]
        rows = rng.choice(len(agents), max(len(agents) // 100, 8), replace=False)
        for number, row in enumerate(rows.tolist()):
            field, value = ROW_DAMAGES[number % len(ROW_DAMAGES)]
            agents[row][field] = value
        tracks = set(agents["track_id"][rows].tolist())
        rewrite(path, tables)
        return RowDamage(frozenset(map(str, tracks)))

    def damage_input(self, path: Path, rng: np.random.Generator) -> str:
        if path.name in (".zarray", ".zattrs", ".zgroup"):
            return damage_json(path, rng)
        if path.name.isdigit():
            return damage_records(path, rng)
        return super().damage_input(path, rng)


ROW_DAMAGES = [
    ("extent", 0.0),
    ("centroid", np.nan),
    ("extent", (4.0, np.nan, 1.0)),
    ("centroid", 1e12),
    ("yaw", np.inf),
    ("velocity", 1e30),
    ("extent", 1e9),
    ("extent", -1.0),
]


def read_tables(path: Path) -> dict[str, np.ndarray]:
    tables = {name: ChunkedTable(path / name) for name in fixture.CHUNKS if (path / name).is_dir()}
    return {name: table.rows(0, len(table)).copy() for name, table in tables.items()}


def rewrite(path: Path, tables: dict[str, np.ndarray]) -> None:
    """Write tables in place of those of a recording."""
    for name, rows in tables.items():
        for file in (path / name).iterdir():
            file.unlink()
        (path / name).rmdir()
        fixture.write_array(path / name, rows, fixture.CHUNKS[name])


def damage_records(path: Path, rng: np.random.Generator) -> str:
    """Change random bytes of the records of a chunk, which stays a valid chunk."""
    table = ChunkedTable(path.parent)
    try:
        data = bytearray(table._decode(path).tobytes())
    except CorruptSource:
        return damage_file(path, rng)
    count = int(rng.integers(1, 200))
    for place in rng.integers(0, len(data), count):
        data[place] = int(rng.integers(256))
    path.write_bytes(table._codec.encode(bytes(data)) if table._codec else data)
    return f"{count} bytes of records changed"


def test_fifteen_flat_boxes_cost_fifteen_rows(tmp_path):
    raw = fixture.write_dataset(tmp_path / "lyft", num_scenes=2, num_frames=30)
    path = raw / "scenes" / "sample.zarr"
    tables = read_tables(path)
    rows = np.linspace(0, len(tables["agents"]) - 1, 15).astype(int)
    tables["agents"]["extent"][rows, 2] = 0.0
    rewrite(path, tables)
    report = convert("lyft", raw, tmp_path / "lake")
    assert (report.converted, report.quarantined) == (2, 0)
    (defect,) = (each for each in report.defects if each.table == "tracks")
    assert defect.count == 15
    assert (defect.file, defect.field, defect.action) == ("scenes/sample.zarr/agents", "extent", "dropped")
    assert defect.location.startswith("rows 0, ")
    assert "expected a size above 0 and up to 200 m, found " in defect.reason


def test_repeated_row_is_dropped_and_one_bad_pose_costs_one_state(tmp_path):
    raw = fixture.write_dataset(tmp_path / "lyft", num_scenes=1, num_frames=30)
    path = raw / "scenes" / "sample.zarr"
    tables = read_tables(path)
    agents, frames = tables["agents"], tables["frames"]
    first, last = frames["agent_index_interval"][3]
    agents[last - 1] = agents[first]
    frames["ego_translation"][20, 0] = np.nan
    rewrite(path, tables)
    report = convert("lyft", raw, tmp_path / "lake")
    assert report.converted == 1
    found = [(d.file.rpartition("/")[2], d.field, d.location) for d in report.defects if d.table == "tracks"]
    assert sorted(found) == [
        ("agents", "track_id", f"row {last - 1:,}"),
        ("frames", "ego_position", "row 20"),
        ("frames", "ego_translation", "row 20"),
    ]


def test_bad_map_element_costs_its_feature(tmp_path):
    raw = fixture.write_dataset(tmp_path / "lyft", num_scenes=1, num_frames=20)
    map_file = raw / "semantic_map" / "semantic_map.pb"
    whole = read_city(map_file, raw / "meta.json")
    city = world.semantic_map()
    lanes = [element for element in city.elements if element.element.HasField("lane")]
    del lanes[0].element.lane.left_boundary.vertex_deltas_z_cm[:1]
    lost = lanes[0].id.id.decode()
    map_file.write_bytes(city.SerializeToString())
    damaged = read_city(map_file, raw / "meta.json")
    (lanes_without_sides,) = whole.features.defects
    assert "expected at least 2 points on each side, found " in lanes_without_sides.reason
    defect, others = damaged.features.defects
    assert others == lanes_without_sides
    assert (defect.count, defect.table, defect.file) == (1, "maps", "semantic_map/semantic_map.pb")
    assert set(whole.exits) - set(damaged.exits) == {lost}
    report = convert("lyft", raw, tmp_path / "lake")
    assert (report.converted, report.dropped) == (1, 1 + lanes_without_sides.count)


def test_what_is_not_read_is_listed(tmp_path):
    raw = fixture.write_dataset(tmp_path / "lyft", num_scenes=1, num_frames=20, name="train")
    fixture.write_recording(raw / "scenes" / "validate.zarr", num_scenes=1, num_frames=20)
    mask = raw / "scenes" / "train.zarr" / "agents_mask"
    mask.mkdir()
    (mask / ".zarray").write_text(json.dumps({}))
    report = convert("lyft", raw, tmp_path / "lake", split="train")
    assert [(each.what, each.count, each.reason) for each in report.passed_over] == [
        ("recordings validate.zarr", 1, "of another split than train"),
        (f"files *.zarray: {os.path.relpath(mask, raw)}/.zarray", 1, "not read by this converter"),
    ]
