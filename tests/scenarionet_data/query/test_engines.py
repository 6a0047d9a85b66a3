"""Other engines read the files of a snapshot directly and get the same results as SQL on the lake."""

from __future__ import annotations

import duckdb
import polars as pl
import pytest

from scenarionet_data import Lake
from scenarionet_data.query.statements import shows_every_column
from scenarionet_data.storage.files.local import LocalLakeFiles
from scenarionet_data.storage.snapshots import commit as commits
from tests.fixtures.lakes import write_shard
from tests.fixtures.scenarios import make_scenario


@pytest.fixture(scope="module")
def lake(tmp_path_factory):
    """Three shards, one of which has been replaced: its old files are still in the folder."""
    root = tmp_path_factory.mktemp("engines")
    old = [write_shard(root, [make_scenario(k) for k in (3 * n, 3 * n + 1)], name=f"shard{n}") for n in range(3)]
    commits.commit(LocalLakeFiles(root), old, "test")
    new = write_shard(root, [make_scenario(0)], name="shard0", fingerprint="g")
    commits.commit(LocalLakeFiles(root), [new], "replace", frozenset({old[0].key}))
    return Lake(root)


def wanted(lake):
    """Number of objects and the highest speed along x, by type."""
    return lake.sql("""
        SELECT object_type, count(*) AS n, max(list_max(vx)) AS vx FROM tracks GROUP BY ALL ORDER BY object_type
    """)


def test_polars(lake):
    tracks = pl.scan_parquet(lake.paths("tracks"), hive_partitioning=True)
    found = tracks.group_by(pl.col("object_type").cast(pl.String)).agg(
        pl.len().cast(pl.Int64).alias("n"), pl.col("vx").list.max().max()
    )
    assert found.sort("object_type").collect().equals(wanted(lake))
    assert tracks.select("dataset", "version", "split").unique().collect().row(0) == ("made", "v1", "train")
    metadata = pl.scan_parquet(lake.paths("metadata"))
    ids = tracks.join(metadata, on="scenario_id").select("scenario_id").unique().collect()["scenario_id"]
    assert sorted(ids) == lake.sql("SELECT scenario_id FROM metadata ORDER BY ALL")["scenario_id"].to_list()


def test_folder_holds_files_outside_the_snapshot(lake):
    """Read the file list of the snapshot, not the folder."""
    folder = pl.scan_parquet(f"{lake.root}/tracks/**/*.parquet").select(pl.len()).collect().item()
    assert folder > wanted(lake)["n"].sum()


@pytest.mark.long
@pytest.mark.filterwarnings("ignore:The inplace keyword")  # Dask 2026.8 with pandas 3.1
def test_dask(lake):
    frame = pytest.importorskip("dask.dataframe", reason="the extra [cluster]")
    tracks = frame.read_parquet(lake.paths("tracks"), columns=["scenario_id", "object_type"])
    assert tracks.npartitions == len(lake.paths("tracks"))
    metadata = frame.read_parquet(lake.paths("metadata"), columns=["scenario_id", "ego_distance"])
    together = tracks.merge(metadata, on="scenario_id")
    counted = together.groupby("object_type").scenario_id.count().compute()
    assert sorted(counted.items()) == [(kind, n) for kind, n, _ in wanted(lake).rows()]


def test_progress_bars_are_turned_off(lake, monkeypatch):
    """As in notebooks, where DuckDB turns them on."""
    connect = duckdb.connect

    def in_notebook(**options):
        connection = connect(**options)
        connection.execute("SET enable_progress_bar = true")
        return connection

    monkeypatch.setattr(duckdb, "connect", in_notebook)
    rows = Lake(lake.root).sql("SELECT current_setting('enable_progress_bar') AS shown FROM metadata LIMIT 1")
    assert rows["shown"].to_list() == [False]


@pytest.mark.parametrize(
    ("sql", "shows"),
    [
        ("SELECT * FROM metadata", True),
        ("SELECT COLUMNS('map') FROM metadata", True),
        ("SELECT metadata FROM metadata", True),
        ("SELECT M FROM metadata AS m", True),
        ("SELECT scenario_id FROM (SELECT * FROM metadata)", True),
        ("SELECT scenario_id FROM metadata", False),
        ("SELECT m.scenario_id FROM metadata AS m", False),
        ("SELECT count(*) FROM metadata", False),
        ("SUMMARIZE metadata", True),
    ],
)
def test_queries_that_show_every_column_are_known(sql, shows):
    with duckdb.connect() as connection:
        assert bool(shows_every_column(connection, sql)) is shows
