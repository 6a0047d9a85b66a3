"""User columns: added from Python, SQL, events and files, queried like built-in columns, pinned by lineage."""

from __future__ import annotations

import shutil
from pathlib import Path

import polars as pl
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from scenarionet_data import Lake
from scenarionet_data.databases import user_columns
from scenarionet_data.errors import (
    BadParameter,
    QueryError,
    ScenarioNotFound,
    UnsafeSql,
    UserColumnExists,
    UserColumnInUse,
    UserColumnNotFound,
)  # fmt: skip
from scenarionet_data.storage.snapshots import commit as commits
from tests.fixtures.lakes import write_lake
from tests.fixtures.scenarios import make_scenario

SCENARIOS = [make_scenario(seed, num_objects=2 + seed % 3, num_steps=12, num_lanes=1) for seed in range(6)]
IDS = [scenario.id for scenario in SCENARIOS]


@pytest.fixture(scope="module")
def _written(tmp_path_factory) -> Path:
    return write_lake(tmp_path_factory.mktemp("written") / "lake", SCENARIOS).root


@pytest.fixture
def lake(_written, tmp_path) -> Lake:
    return Lake(shutil.copytree(_written, tmp_path / "lake"))


@pytest.fixture(scope="module")
def _with_columns(_written, tmp_path_factory) -> Path:
    """A lake with the user columns ``score`` and ``kind``."""
    lake = Lake(shutil.copytree(_written, tmp_path_factory.mktemp("with_columns") / "lake"))
    lake.tag("score", {name: k for k, name in enumerate(IDS)})
    lake.tag("kind", dict.fromkeys(IDS, "a"))
    return lake.root


def files(lake):
    return {path: path.read_bytes() for path in lake.root.rglob("*.parquet")}


def column(lake, name):
    return dict(lake.refresh().sql(f"SELECT scenario_id, {name} FROM metadata").rows())


def test_tag_is_a_column_and_rewrites_nothing(lake):
    before = files(lake)
    made = lake.tag("score", dict(zip(IDS[:4], [1.5, 2.5, 3.5, None], strict=True)))
    assert (made.reference, made.type, made.count, made.source) == ("score@1", "double", 3, "python")
    assert column(lake, "score") == dict.fromkeys(IDS) | dict(zip(IDS[:3], [1.5, 2.5, 3.5], strict=True))
    after = files(lake)
    (added,) = after.keys() - before.keys()
    assert added.relative_to(lake.root).as_posix() == "layers/score/1.parquet"
    assert {path: after[path] for path in before} == before
    assert len(lake.refresh()) == len(IDS)
    assert lake.refresh().describe(IDS[0])["score"] == 1.5


def test_tag_is_usable_in_filter_split_and_sample(lake):
    lake.tag("score", {name: float(k) for k, name in enumerate(IDS)})
    lake.refresh().tag("kind", {name: "ab"[k % 2] for k, name in enumerate(IDS)})
    lake = lake.refresh()
    found = lake.filter("score >= 2 AND kind = 'a'", name="best")
    assert found.scenario_ids == [IDS[2], IDS[4]]
    assert found.lineage.user_columns == ["kind@1", "score@1"]
    assert lake.filter("num_objects > 0", name="all").lineage.user_columns == []
    parts = lake.split("all", {"x": 0.5, "y": 0.5}, by="kind", allow_empty=True)
    kinds = [{column(lake, "kind")[name] for name in part.scenario_ids} for part in parts.values()]
    assert kinds[0].isdisjoint(kinds[1])


def test_embedding_is_searchable(lake):
    vectors = [[1.0, 0.0], [0.0, 1.0], [0.8, 0.6], [-1.0, 0.0], [0.6, 0.8], [0.0, -1.0]]
    table = pa.table({"scenario_id": IDS, "vector": pa.array(vectors, pa.list_(pa.float32()))})
    assert lake.tag("embedding", table).type == "list<item: float>"
    query = """
        SELECT scenario_id FROM metadata ORDER BY list_cosine_similarity(embedding, $like::FLOAT[]) DESC LIMIT 2
    """
    near = lake.refresh().sql(query, {"like": [1.0, 0.1]})
    assert near["scenario_id"].to_list() == [IDS[0], IDS[2]]


def test_tags_from_sql_conditions_and_events(lake):
    made = lake.tag_by_sql("steps_seen", "SELECT scenario_id, count(*) FROM states GROUP BY scenario_id")
    assert column(lake, "steps_seen") == {s.id: int(s.tracks.valid.sum()) for s in SCENARIOS}
    assert "FROM states" in made.source
    lake.refresh().tag_where("crowded", "num_objects > 3")
    counted = column(lake, "num_objects")
    assert column(lake, "crowded") == {name: number > 3 for name, number in counted.items()}
    lake.tag_event("approaches", "closest_approach:max=30")
    hits = lake.mine("closest_approach", {"max": 30})["scenario_id"].to_list()
    assert column(lake, "approaches") == {name: hits.count(name) for name in IDS}
    lake.refresh().tag_by_sql("twice", "SELECT scenario_id, 2 * approaches AS v FROM metadata")
    assert column(lake, "twice") == {name: 2 * hits.count(name) for name in IDS}


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_tags_from_files(lake, suffix, tmp_path):
    path = tmp_path / f"scores.{suffix}"
    rows = pl.DataFrame({"scenario_id": IDS[::-1], "score": range(6), "word": list("abcdef")})
    rows.write_csv(path) if suffix == "csv" else rows.write_parquet(path)
    assert lake.tag_from_file("score", path, "score").source == path.name
    assert column(lake, "score") == dict(zip(IDS[::-1], range(6), strict=True))
    lake.tag_from_file("letter", path, "word")
    assert column(lake, "letter")[IDS[0]] == "f"
    with pytest.raises(BadParameter, match="no column points; there are scenario_id, score, word"):
        lake.tag_from_file("other", path, "points")
    with pytest.raises(BadParameter, match="select two columns"):
        lake.tag_from_file("other", path)


def test_invalid_tag_files_are_refused(lake, tmp_path):
    (tmp_path / "x.parquet").write_bytes(b"PAR1")
    (tmp_path / "x.csv").write_bytes(b'a,"\n')
    (tmp_path / "x.txt").write_text("a")
    for name in ("x.parquet", "x.txt", "gone.csv"):
        with pytest.raises(BadParameter, match=name):
            lake.tag_from_file("score", tmp_path / name)


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("num_objects", "is a column of every lake"),
        ("objects_per_100m", "is a column of every lake"),
        ("weight", "is a column of every lake"),
        ("Score", "not a valid name of a user column"),
        ("my-score", "not a valid name of a user column"),
        ("../x", "not a valid name of a user column"),
        ("", "not a valid name of a user column"),
        ("select", "an SQL keyword"),
    ],
)
def test_invalid_column_names_are_refused(lake, name, reason):
    with pytest.raises(BadParameter, match=reason):
        lake.tag(name, {IDS[0]: 1})


def test_mismatched_rows_are_refused(lake):
    with pytest.raises(ScenarioNotFound, match=r"1 of 2 ids .* made/v1/s00000x; ids look like made/v1/s00000"):
        lake.tag("score", {IDS[0]: 1, "made/v1/s00000x": 2})
    with pytest.raises(ScenarioNotFound, match=rf"2 of 2 ids .* {IDS[3]}x; ids look like {IDS[3]}$"):
        lake.tag("score", {"zzz": 1, f"{IDS[3]}x": 2})
    with pytest.raises(BadParameter, match="each scenario_id once"):
        lake.tag("score", pa.table({"scenario_id": [IDS[0], IDS[0]], "v": [1, 2]}))
    with pytest.raises(BadParameter, match="each scenario_id once"):
        lake.tag("score", pa.table({"scenario_id": pa.array([None], pa.string()), "v": [1]}))
    with pytest.raises(BadParameter, match="one more column, found a, b"):
        lake.tag("score", pa.table({"a": [1], "b": [1]}))
    with pytest.raises(UnsafeSql):
        lake.tag_by_sql("score", "COPY (SELECT 1) TO 'x'")
    with pytest.raises(UnsafeSql):
        lake.tag_where("score", "1; SELECT 2")
    with pytest.raises(QueryError):
        lake.tag_where("score", "nothing > 1")
    assert user_columns.current(lake.files, {}) == {}


def test_old_versions_are_kept_and_lineage_pins_the_version_used(lake):
    lake.tag("score", {name: float(k) for k, name in enumerate(IDS)})
    lake = lake.refresh()
    lake.filter("score >= 4", name="best")
    with pytest.raises(UserColumnExists, match="replace=True"):
        lake.tag("score", {IDS[0]: 9.0})
    assert lake.tag("score", {IDS[0]: 9.0}, replace=True).reference == "score@2"
    newest = lake.refresh()
    assert newest.filter("score >= 4", name="again").scenario_ids == [IDS[0]]
    assert newest.database("best").lineage.user_columns == ["score@1"]
    assert newest.rebuild("best").is_same
    assert newest.rebuild("again").is_same
    assert Lake(lake.root, user_columns={"score": 1}).sql("SELECT max(score) FROM metadata").item() == 5.0
    found = user_columns.read(lake.files, "score", 1)
    assert (found.count, found.snapshot) == (6, 1)


@pytest.mark.long
@pytest.mark.parametrize(
    ("query", "joined"),
    [
        ("SELECT count(*) AS n FROM metadata", set()),
        ("SELECT 2 * num_objects AS score FROM metadata", {"score"}),
        ("SELECT scenario_id FROM metadata WHERE Score > 1", {"score"}),
        ("SELECT * FROM metadata", {"score", "kind"}),
        ("FROM metadata", {"score", "kind"}),
        ("SELECT m.* FROM metadata AS m WHERE num_objects > 0", {"score", "kind"}),
        ("SELECT COLUMNS('s.*') FROM metadata", {"score", "kind"}),
        ("SELECT metadata FROM metadata", {"score", "kind"}),
        ("SELECT to_json(m) FROM metadata AS m", {"score", "kind"}),
        ("SELECT t.x FROM tracks AS t JOIN metadata AS m ON m.scenario_id = t.scenario_id", set()),
        ("SELECT max(each) FROM (SELECT M AS each FROM tracks JOIN Metadata m USING (scenario_id))", {"score", "kind"}),
        ("SELECT num_objects AS n FROM metadata AS m ORDER BY n", set()),
        ("SELECT x FROM tracks", set()),
    ],
)
def test_only_queried_user_columns_are_joined(_with_columns, query, joined):
    lake = Lake(_with_columns)
    lake.sql("SELECT kind, score FROM metadata")
    lake.arrow(query)
    views = lake.arrow("SELECT sql FROM duckdb_views() WHERE view_name LIKE 'meta%a'")["sql"].to_pylist()
    assert {name for name in ("score", "kind") if f"/{name}/" in "".join(views)} == joined | (
        set()
        if "metadata" in query
        else {"score", "kind"}  # queries that do not read metadata leave the view unchanged
    )


def test_database_query_joins_only_named_columns(lake):
    lake.tag("score", {name: float(k) for k, name in enumerate(IDS)})
    lake.tag("kind", dict.fromkeys(IDS, "a"))
    lake = lake.refresh()
    kind = lake.root / "layers" / "kind" / "1.parquet"
    whole = kind.read_bytes()
    kind.write_bytes(b"damaged")
    assert lake.filter("score >= 2", name="best").scenario_ids == IDS[2:]
    kind.write_bytes(whole)
    assert lake.filter("COLUMNS('sc.re') >= 4", name="few", allow_empty=True, database="best").lineage.user_columns == [
        "kind@1", "score@1",
    ]  # fmt: skip


def test_user_columns_are_dropped_unless_a_lineage_needs_them(lake):
    lake.tag("score", {name: float(k) for k, name in enumerate(IDS)})
    lake.tag("score", {IDS[0]: 9.0}, replace=True)
    lake.tag("kind", dict.fromkeys(IDS, "a"))
    lake = Lake(lake.root, user_columns={"score": 1})
    lake.filter("score >= 4", name="best")
    with pytest.raises(
        UserColumnInUse, match=r"score is needed .*: best@1 uses score@1; drop those first, or force=True"
    ):
        lake.untag("score")
    with pytest.raises(UserColumnNotFound, match=r"no user column 'score@7'; versions \[1, 2\]"):
        lake.untag("score@7")
    with pytest.raises(UserColumnNotFound, match="no user column 'scores'; user columns: kind, score"):
        lake.untag("scores")
    lake.untag("score@2")
    lake.untag("kind")
    assert lake.refresh().user_columns == {"score": 1}
    with pytest.raises(QueryError, match="kind"):
        lake.refresh().sql("SELECT kind FROM metadata")
    lake.untag("score", force=True)
    assert lake.refresh().user_columns == {}
    lake = lake.refresh()
    assert lake.database("best").scenario_ids == IDS[4:]
    with pytest.raises(UserColumnNotFound, match=r"best@1 cannot be made again as it was: .*no user column 'score@1'"):
        lake.rebuild("best")
    assert lake.tag("score", {IDS[0]: 1.0}).reference == "score@3"  # not one of those that were dropped
    with pytest.raises(UserColumnNotFound, match="score@1"):
        lake.refresh().rebuild("best")


def test_misspelled_column_suggests_a_close_match(lake):
    lake.tag("loneliness", {IDS[0]: 1.0})
    with pytest.raises(QueryError, match=r"no column lonelines at character 1 .* similar: loneliness"):
        lake.refresh().filter("lonelines > 0", name="x")


def test_unrelated_folders_are_ignored(lake):
    lake.tag("score", {IDS[0]: 1})
    shutil.copytree(lake.root / "layers" / "score", lake.root / "layers" / "a JOIN b")
    (lake.root / "layers" / "empty").mkdir()
    assert lake.refresh().user_columns == {"score": 1}
    assert column(lake, "score")[IDS[0]] == 1


def test_user_columns_survive_metadata_rewrites(lake):
    lake.tag("score", {name: k for k, name in enumerate(IDS)})
    before = column(lake, "score")
    commits.consolidate(lake.files)
    assert column(lake, "score") == before
    more = [make_scenario(99, num_objects=2, num_steps=4)]
    assert column(write_lake(lake.root, more, name="b"), "score") == before | {more[0].id: None}


def test_other_readers_notice_damage_by_checksums(lake):
    lake.tag("score", {name: 0.1 * k for k, name in enumerate(IDS)})
    (path,) = (Path(lake.root) / "layers").rglob("*.parquet")
    content = bytearray(path.read_bytes())
    start = pq.read_metadata(path).row_group(0).column(1).data_page_offset
    content[start - 2] ^= 1  # in the page before, of the dictionary
    path.write_bytes(content)
    with pytest.raises(OSError, match="CRC checksum"):
        pq.ParquetFile(path, page_checksum_verification=True).read()
