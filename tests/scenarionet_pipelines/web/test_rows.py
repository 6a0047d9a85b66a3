"""Pages of the table contain the same rows as one sorted list."""

from __future__ import annotations

import pytest

from scenarionet_data.errors import BadParameter, QueryError, UnsafeSql
from scenarionet_pipelines.web.rows import PageQuery, columns, read_page

pytestmark = pytest.mark.integration


def ask(lake, where="true", sort="scenario_id", is_falling=False, first=0, count=10, names=()):
    known = {column.name: column for column in columns(lake)}
    return read_page(lake, PageQuery(where, sort, is_falling, first, count, tuple(names)), known)


@pytest.mark.parametrize(
    "sort", ["scenario_id", "num_objects", "ego_distance", "min_ego_gap", "city", "has_intersection"]
)
@pytest.mark.parametrize("is_falling", [False, True])
def test_pages_make_up_the_sorted_list(lake, sort, is_falling):
    direction = "DESC" if is_falling else "ASC"
    wanted = lake.sql(f"SELECT scenario_id FROM metadata ORDER BY {sort} {direction} NULLS LAST, scenario_id")
    pages = [ask(lake, sort=sort, is_falling=is_falling, first=first) for first in range(0, 60, 10)]
    assert [row["scenario_id"] for each in pages for row in each.rows] == wanted["scenario_id"].to_list()
    assert {each.total for each in pages} == {59}


def test_columns_match_the_schema_without_addresses(lake):
    found = {column.name: column for column in columns(lake)}
    assert found["ego_distance"].unit == "m"
    assert found["ego_distance"].is_number
    assert not found["timestamps"].is_sortable
    assert "tracks_file" not in found


def test_values_are_representable_in_javascript(lake):
    (row,) = ask(lake, count=1, names=["content_hash", "timestamps", "has_z", "num_objects"]).rows
    assert isinstance(row["content_hash"], str)
    assert isinstance(row["timestamps"], list)
    assert row["has_z"] is True
    assert isinstance(row["num_objects"], int)


def test_pages_beyond_the_last_are_empty(lake):
    assert ask(lake, first=1000).rows == []
    assert ask(lake, "num_objects > 1e6").total == 0


def test_errors_have_a_position(lake):
    with pytest.raises(QueryError, match=r"no column ego_dist at character 1 .* similar: ego_distance"):
        ask(lake, "ego_dist > 3")
    with pytest.raises(UnsafeSql, match="character 21"):
        ask(lake, "ego_distance > 3 AND)")
    with pytest.raises(BadParameter, match="no column 'nothing'"):
        ask(lake, sort="nothing")
    with pytest.raises(BadParameter, match="cannot be sorted"):
        ask(lake, sort="timestamps")


@pytest.mark.parametrize(
    "where",
    [
        "true; DROP VIEW metadata",
        "true) UNION SELECT 1 --",
        "(COPY metadata TO 'x.csv')",
        "true; COPY metadata TO 'x.parquet'",
        "EXISTS (SELECT * FROM read_text('/etc/passwd'))",
    ],
)
def test_sql_that_writes_or_reads_other_files_is_refused(lake, where):
    before = sorted(lake.root.rglob("*"))
    with pytest.raises(QueryError):
        ask(lake, where)
    assert sorted(lake.root.rglob("*")) == before
