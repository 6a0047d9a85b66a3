"""Published snapshots hold the lake's rows, as other software reads them."""

from __future__ import annotations

import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import polars as pl
import pytest

from scenarionet_data import Lake, convert
from scenarionet_data.errors import BadParameter, MissingDependency
from tests.fixtures import made

pytestmark = pytest.mark.integration

ROOT = Path(__file__).parents[3]
TABLES = ("metadata", "tracks", "lights", "maps")


@pytest.fixture(scope="module")
def lake(tmp_path_factory) -> Lake:
    root = tmp_path_factory.mktemp("published")
    raw = made.write_raw(root / "raw", {"a": [1, 2, 3], "b": [4]})
    convert(made.NAME, str(raw), root / "lake", options={"num_objects": 2})
    lake = Lake(root / "lake")
    lake.tag("mark", {name: k for k, name in enumerate(lake.sql("SELECT scenario_id FROM metadata")["scenario_id"])})
    return Lake(root / "lake")


def assert_same_rows(lake: Lake, table: str, rows: pl.DataFrame, columns: list[str], key: list[str]) -> None:
    expected = lake.sql(f"SELECT {', '.join(columns)} FROM {table}").cast({pl.Categorical: pl.String})
    rows = rows.select(columns).cast({pl.Categorical: pl.String})
    assert rows.sort(key).to_dicts() == expected.sort(key).to_dicts()


def test_iceberg_has_the_rows_of_the_lake(lake, tmp_path):
    catalogs = pytest.importorskip("pyiceberg.catalog.sql", reason="needs the extra iceberg")
    report = lake.publish(tmp_path / "catalog", "iceberg")
    catalog = catalogs.SqlCatalog("lake", uri=f"sqlite:///{tmp_path}/catalog/catalog.sqlite")
    read = {name: pl.from_arrow(catalog.load_table(f"lake.{name}").scan().to_arrow()) for name in TABLES}
    assert report.num_rows == {name: len(rows) for name, rows in read.items()}
    assert_same_rows(lake, "metadata", read["metadata"], ["scenario_id", "dataset", "split", "mark"], ["scenario_id"])
    assert_same_rows(
        lake, "tracks", read["tracks"], ["scenario_id", "track_index", "x", "valid"], ["scenario_id", "track_index"]
    )
    assert_same_rows(lake, "maps", read["maps"], ["map_id", "feature_index", "x"], ["map_id", "feature_index"])
    hashes = lake.sql("SELECT content_hash FROM metadata ORDER BY scenario_id")["content_hash"]
    signed = read["metadata"].sort("scenario_id")["content_hash"]
    assert [value % 2**64 for value in signed] == hashes.to_list()
    referenced = {file["file_path"] for file in catalog.load_table("lake.tracks").inspect.files().to_pylist()}
    assert referenced == set(lake.paths("tracks"))
    catalog.close()


def test_a_catalog_does_not_change_when_the_lake_grows(lake, tmp_path):
    catalogs = pytest.importorskip("pyiceberg.catalog.sql", reason="needs the extra iceberg")
    root = tmp_path / "lake"
    convert(made.NAME, str(made.write_raw(tmp_path / "raw", {"a": [1, 2]})), root)
    report = Lake(root).publish(tmp_path / "catalog", "iceberg")
    assert not report.is_kept
    Lake(root).filter(name="published")
    convert(made.NAME, str(made.write_raw(tmp_path / "raw", {"a": [1, 2], "b": [3]})), root)
    catalog = catalogs.SqlCatalog("lake", uri=f"sqlite:///{tmp_path}/catalog/catalog.sqlite")
    assert catalog.load_table("lake.metadata").scan().to_arrow().num_rows == 2
    catalog.close()


def test_ducklake_has_the_rows_of_the_lake(lake, tmp_path):
    """In an environment of its own: the extension exists for fewer versions of DuckDB than we support."""
    site = os.environ.get("SCENARIONET_DUCKLAKE")
    if not site:
        pytest.skip("DuckLake: `make test-ducklake` runs this with a DuckDB that has the extension")
    script = f"""
import duckdb
from scenarionet_data import Lake
from scenarionet_data.publishing.ducklake import load_extension
report = Lake({str(lake.root)!r}).publish({str(tmp_path / "catalog")!r}, "ducklake")
with duckdb.connect() as connection:
    load_extension(connection)
    connection.execute("ATTACH 'ducklake:{tmp_path}/catalog/lake.ducklake' AS lake (READ_ONLY)")
    for name, number in report.num_rows.items():
        assert connection.execute(f"SELECT count(*) FROM lake.{{name}}").fetchone() == (number,), name
    for name in ("tracks", "metadata"):
        connection.execute(f"COPY (FROM lake.{{name}}) TO '{tmp_path}/{{name}}.parquet'")
"""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([site, str(ROOT)])}
    subprocess.run([sys.executable, "-c", script], check=True, env=environment)
    key = ["scenario_id", "track_index"]
    assert_same_rows(
        lake, "tracks", pl.read_parquet(tmp_path / "tracks.parquet"), ["scenario_id", "split", "track_index", "x"], key
    )
    assert_same_rows(
        lake, "metadata", pl.read_parquet(tmp_path / "metadata.parquet"), ["scenario_id", "mark"], ["scenario_id"]
    )


def test_what_cannot_be_published_is_refused(lake, tmp_path):
    (tmp_path / "there").mkdir()
    with pytest.raises(BadParameter, match="exists"):
        lake.publish(tmp_path / "there", "iceberg")
    with pytest.raises(BadParameter, match="written to this machine"):
        lake.publish("s3://bucket/catalog", "iceberg")


@pytest.mark.skipif(find_spec("duckdb_extension_ducklake") is not None, reason="the extension is installed")
def test_without_the_extension_nothing_is_left(lake, tmp_path):
    with pytest.raises(MissingDependency, match="needs the extension ducklake"):
        lake.publish(tmp_path / "catalog", "ducklake")
    assert not (tmp_path / "catalog").exists()
