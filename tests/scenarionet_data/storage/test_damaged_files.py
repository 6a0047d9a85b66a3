"""Missing, truncated, corrupt or incompatible files are named in the error when they are read."""

from __future__ import annotations

from pathlib import Path

import pyarrow.parquet as pq
import pytest

from scenarionet_data import Lake, ScenarioLoader
from scenarionet_data.errors import LakeError, SchemaMismatch
from scenarionet_data.schema import tables
from scenarionet_data.storage.files.errors import reading
from scenarionet_data.storage.integrity import seals
from tests.fixtures.lakes import write_lake
from tests.fixtures.made import raw_of, run
from tests.fixtures.scenarios import make_scenario


@pytest.fixture
def lake(tmp_path):
    return write_lake(tmp_path / "lake", [make_scenario(k, num_objects=2) for k in (1, 2)])


def one(lake, table):
    (path,) = (Path(path) for path in lake.paths(table))
    return path


@pytest.mark.parametrize("table", ["tracks", "lights", "maps"])
@pytest.mark.parametrize("damage", ["gone", "empty", "cut", "garbage"])
def test_loading_damaged_content_names_the_file(lake, table, damage):
    path = one(lake, table)
    data = path.read_bytes()
    path.unlink()
    if damage != "gone":
        path.write_bytes({"empty": b"", "cut": data[:-9], "garbage": bytes(range(256)) * 40}[damage])
    with pytest.raises(
        LakeError, match=rf"cannot read {path}: .*`scenarionet maintain check` lists the affected scenarios"
    ):
        ScenarioLoader(lake)[0]


def test_loading_damaged_pages_names_the_file(lake):
    path = one(lake, "tracks")
    data = bytearray(path.read_bytes())
    data[4:2000] = bytes(1996)
    path.write_bytes(data)
    with pytest.raises(LakeError, match=f"cannot read {path}"):
        ScenarioLoader(lake)[0]


def test_internals_of_parquet_are_not_said(lake):
    """Thrift's words in a footer that is none."""
    path = one(lake, "tracks")
    data = path.read_bytes()
    size = int.from_bytes(data[-8:-4], "little")
    path.write_bytes(data[: -8 - size] + bytes([0x1F]) * size + data[-8:])
    with pytest.raises(LakeError) as caught, reading(path):
        pq.read_metadata(path)
    assert str(caught.value).startswith(f"cannot read {path}: its headers are damaged; `scenarionet")


@pytest.mark.parametrize("table", ["tracks", "lights", "maps"])
def test_file_of_another_schema_is_refused(lake, table):
    path = one(lake, table)
    rows = pq.read_table(path, partitioning=None)
    tag = {**rows.schema.metadata, b"scenarionet.schema": f"{table}/99".encode()}
    pq.write_table(rows.replace_schema_metadata(tag), path)
    seals.seal(path, seals.Place(path.relative_to(lake.root).as_posix()))
    with pytest.raises(
        SchemaMismatch,
        match=rf"{path.name}: written under schema {table}/99, this version reads {tables.load(table).tag}",
    ):
        ScenarioLoader(lake)[0]


def test_missing_metadata_is_named(lake):
    one(lake, "metadata").unlink()
    with pytest.raises(LakeError, match="metadata"):
        ScenarioLoader(lake.root)


@pytest.mark.parametrize("data", [None, b"", b"PAR1" * 9])
def test_damaged_manifest_is_named(lake, data):
    path = next(lake.root.glob("snapshots/manifest-*.parquet"))
    path.unlink()
    if data is not None:
        path.write_bytes(data)
    with pytest.raises(LakeError, match=f"cannot read {path}"):
        len(Lake(lake.root))
    with pytest.raises(LakeError, match=f"cannot read {path}"):
        run(raw_of(lake.root.parent / "raw", 5, 1), lake.root)
