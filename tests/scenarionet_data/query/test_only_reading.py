"""Queries are read-only, whatever their form; results are data frames."""

from __future__ import annotations

import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import polars as pl
import pytest

from scenarionet_data.errors import (
    LakeError,
    QueryError,
)
from tests.fixtures.lakes import write_lake
from tests.fixtures.scenarios import make_scenario, varied


def unsafe(root):
    """Statements that modify something or read outside the lake."""
    return [
        "INSERT INTO metadata VALUES (1)",
        "UPDATE metadata SET city = 'x'",
        "DELETE FROM metadata",
        "MERGE INTO metadata USING metadata ON true WHEN MATCHED THEN DELETE",
        "CREATE TABLE t AS SELECT 1",
        "CREATE VIEW v AS SELECT 1",
        "CREATE MACRO f(a) AS a + 1",
        "CREATE SECRET s (TYPE s3)",
        "DROP VIEW metadata",
        "ALTER VIEW metadata RENAME TO x",
        "COMMENT ON VIEW metadata IS 'x'",
        f"ATTACH '{root}/x.db'",
        "DETACH memory",
        "USE memory",
        f"COPY (SELECT 1) TO '{root}/x'",
        f"COPY metadata TO '{root}/x.parquet'",
        f"WITH t AS (COPY (SELECT 1) TO '{root}/x') SELECT * FROM t",
        f"(WITH t AS (COPY (SELECT 1) TO '{root}/x') SELECT * FROM t)",
        f"WITH t AS MATERIALIZED (COPY (SELECT 1) TO '{root}/x') SELECT 1 UNION ALL SELECT 2",
        "WITH t AS (INSERT INTO metadata VALUES (1) RETURNING *) SELECT * FROM t",
        f"EXPORT DATABASE '{root}/x'",
        f"IMPORT DATABASE '{root}/x'",
        "SET threads = 1",
        "RESET threads",
        "SET VARIABLE tracks_files = ['x']",
        "INSTALL httpfs",
        "LOAD httpfs",
        "CALL pragma_version()",
        "EXPLAIN SELECT 1",
        "CHECKPOINT",
        "VACUUM",
        "BEGIN",
        "PREPARE p AS SELECT 1",
        "EXECUTE p",
        "SELECT 1; SELECT 2",
        "SELECT 1; DROP VIEW metadata",
        "SELECT 1) AS x; DROP VIEW metadata; SELECT * FROM (SELECT 1",
        "",
        ";",
        "-- nothing",
        "SELECT * FROM read_text('/etc/passwd')",
        "SELECT * FROM read_csv('/etc/passwd')",
        "SELECT * FROM '/etc/passwd.csv'",
        f"SELECT * FROM read_text('{root}/../secret.csv')",
        f"SELECT * FROM read_text('{root}2/secret.csv')",
        "SELECT * FROM 'secret.csv'",
        "SELECT * FROM glob('/etc/*')",
        "SELECT * FROM sniff_csv('/etc/passwd')",
        "SELECT * FROM parquet_metadata('/etc/passwd')",
        "SELECT * FROM 'https://example.com/x.parquet'",
        "SELECT * FROM query('DROP VIEW metadata')",
        "SELECT * FROM frame",
        "SELECT (SELECT count(*) FROM read_text('/etc/passwd'))",
        "SELECT nonsense FROM metadata",
        "SELECT * FROM nothing",
        "SELEKT 1",
        "SELECT $missing",
    ]


def files_below(folder):
    return sorted(str(path) for path in folder.rglob("*"))


def test_unsafe_statement_is_refused(tmp_path, monkeypatch):
    root = tmp_path / "lake"
    lake = write_lake(root, [make_scenario(1, num_objects=2)])
    (tmp_path / "secret.csv").write_text("a\n1\n")
    (tmp_path / "lake2").mkdir()
    (tmp_path / "lake2" / "secret.csv").write_text("a\n1\n")
    monkeypatch.chdir(tmp_path)
    frame = pl.DataFrame({"a": [1]})  # a variable that DuckDB would find by its name
    before = files_below(tmp_path)
    for query in unsafe(root):
        try:
            lake.sql(query)
        except (QueryError, LakeError) as error:  # DuckDB 1 looks up the files of IMPORT while parsing
            assert str(error), query
        else:
            pytest.fail(f"was not refused: {query}")
    assert files_below(tmp_path) == before
    assert len(lake) == 1
    assert len(frame) == 1


@pytest.mark.parametrize(
    "query",
    [
        "SELECT 1 AS a;",
        "SELECT 1 AS a -- a comment; with a semicolon",
        "/* what */ SELECT 1 AS a",
        "FROM (VALUES (1)) AS t(a)",
        "WITH t AS (SELECT 1 AS a) SELECT * FROM t",
        "SELECT 1 AS a UNION SELECT 1",
        "SELECT $a::INTEGER AS a",
        "VALUES (1)",
        "SELECT ';' AS a",
    ],
)
def test_reading_statements_of_any_form_are_allowed(lake, query):
    assert len(lake.sql(query, {"a": 1} if "$a" in query else None)) == 1


def test_describe_statements_are_allowed(lake):
    assert "ego_distance" in lake.sql("DESCRIBE metadata")["column_name"].to_list()
    assert len(lake.sql("SUMMARIZE metadata")) > 50


def test_order_and_limit_are_kept(lake):
    ids = sorted(scenario.id for scenario in varied())
    query = "SELECT scenario_id FROM metadata ORDER BY scenario_id DESC LIMIT 3 OFFSET 1"
    assert lake.sql(query)["scenario_id"].to_list() == ids[::-1][1:4]


@pytest.mark.long
def test_concurrent_queries_from_threads(tmp_path):
    """A server queries from many threads; results must not be mixed up."""
    lake = write_lake(tmp_path, [make_scenario(k, num_objects=2, num_steps=4) for k in range(8)])
    ids = lake.sql("SELECT scenario_id FROM metadata ORDER BY 1")["scenario_id"].to_list()
    lake = lake.refresh()

    def ask(k):
        states = lake.sql("SELECT $k AS k, count(*) AS n FROM states WHERE timestep = $t", {"k": k, "t": k % 4})
        return states["k"][0], lake.resolve(ids[k % 8 :])[1]["scenario_id"].to_pylist()

    with ThreadPoolExecutor(8) as pool:
        assert list(pool.map(ask, range(40))) == [(k, ids[k % 8 :]) for k in range(40)]


def test_large_queries_spill_into_separate_temporary_folders(lake):
    query = "SELECT current_setting('temp_directory') AS folder"
    folders = [Path(opened.sql(query).item()) for opened in (lake, lake.refresh())]
    assert folders[0] != folders[1]
    assert {folder.parent for folder in folders} == {Path(tempfile.gettempdir())}


def test_tables_of_one_query_are_invisible_to_the_next(own):
    own.filter("true", name="all")
    own.filter("true", name="again", database="all")
    for table in ("members", "wanted"):
        with pytest.raises(QueryError, match=f"{table} does not exist"):
            own.sql(f"SELECT * FROM {table}")


def test_unsupported_results_are_query_errors(lake):
    with pytest.raises(QueryError, match="cast unsupported types to VARCHAR"):
        lake.sql("SELECT INTERVAL 1 MONTH AS i")
