"""Lakes in an object store: the same operations as on a folder, with few requests."""

from __future__ import annotations

import pickle
import subprocess
import sys

import pytest

from scenarionet_data import Lake, ScenarioLoader
from scenarionet_data.errors import DatabaseExists, LakeError, MissingDependency, NoSuchSnapshot, QueryError
from scenarionet_data.storage.files import remote
from scenarionet_data.storage.files.local import LocalLakeFiles
from scenarionet_data.storage.files.places import open_files
from scenarionet_data.storage.read import scenario_reader
from scenarionet_data.storage.read.parquet import column_reader, footer
from scenarionet_data.testing import differences
from tests.fixtures.lakes import write_lake
from tests.fixtures.scenarios import make_scenario

pytestmark = pytest.mark.integration

MADE = [make_scenario(seed, num_objects=4, num_steps=11) for seed in range(6)]
ASKED = "SELECT scenario_id, count(*) AS n, sum(len(x)) AS states FROM tracks GROUP BY ALL ORDER BY ALL"


def test_lake_in_a_bucket(url, store, tmp_path):
    """Written, queried, filtered and loaded like one in a folder; a scenario takes at most three requests."""
    lake, local = write_lake(url, MADE), write_lake(tmp_path / "lake", MADE)
    assert [path.removeprefix(f"{url}/") for path in lake.paths("tracks")] == [
        path.removeprefix(f"{local.root}/") for path in local.paths("tracks")
    ]
    assert lake.sql(ASKED).equals(local.sql(ASKED))
    database = lake.filter("source_scenario_id <> 's000002'", name="most")
    loaded = ScenarioLoader(Lake(url), "most")
    assert loaded.scenario_ids == database.scenario_ids == [s.id for s in MADE if not s.id.endswith("2")]
    assert differences(loaded[0], MADE[0]) == []  # the footers are cached now
    store.set()
    assert differences(loaded[3], MADE[4]) == []
    assert [method for method, _, _ in store.requests()] == ["GET"] * 3
    store.set()
    assert [differences(loaded[k], MADE[m]) for k, m in ((4, 5), (1, 1))] == [[], []]
    assert all(
        differences(a, b) == [] for a, b in zip(loaded.batch([4, 0, 4]), (MADE[5], MADE[0], MADE[5]), strict=True)
    )


@pytest.fixture
def lake(url):
    return write_lake(url, MADE)


def test_arrow_reads_use_byte_ranges(lake, store, monkeypatch):
    monkeypatch.setattr(column_reader.ColumnReader.__init__, "__defaults__", (None, 0))
    monkeypatch.setattr(footer, "_KNOWN", {"float32": footer._KNOWN["float32"]})  # leave the rest to Arrow
    loaded = ScenarioLoader(lake)
    assert [differences(a, b) for a, b in zip(loaded.batch(range(6)), MADE, strict=True)] == [[]] * 6
    store.set()
    assert differences(loaded[2], MADE[2]) == []
    assert len(store.requests()) == 3


@pytest.mark.long
def test_batch_is_fetched_together(lake, store):
    loaded = ScenarioLoader(lake)
    scenarios = list(loaded)
    assert [differences(a, b) for a, b in zip(scenarios, MADE, strict=True)] == [[]] * 6
    store.set()
    assert len(loaded.batch(range(6))) == 6
    assert len(store.requests()) == 3  # one contiguous run of row groups per table
    store.set()
    assert len(loaded.batch_tracks(range(6))) == 6
    assert len(store.requests()) == 1


@pytest.mark.long
def test_batches_load_while_footers_are_evicted(url, monkeypatch):
    monkeypatch.setattr(scenario_reader, "_MAX_FOOTERS", 2)
    for k, scenario in enumerate(MADE):
        lake = write_lake(url, [scenario], name=f"shard{k}")
    loaded = ScenarioLoader(lake)
    for _ in range(2):
        assert [differences(a, b) for a, b in zip(loaded.batch(range(6)), MADE, strict=True)] == [[]] * 6
        assert [differences(a, b) for a, b in zip(loaded, MADE, strict=True)] == [[]] * 6
    assert len(loaded._reader._row_groups._footers) <= 18


@pytest.mark.long
def test_long_footers_are_read_completely(lake, monkeypatch):
    monkeypatch.setattr(remote, "FOOTER", 64)
    assert differences(ScenarioLoader(lake)[2], MADE[2]) == []


@pytest.mark.long
def test_loader_is_picklable(lake):
    loaded = pickle.loads(pickle.dumps(ScenarioLoader(lake)))
    assert differences(loaded[1], MADE[1]) == []


@pytest.mark.long
def test_reopening_a_lake_needs_few_requests(lake, store):
    store.set()
    assert len(Lake(lake.root)) == 6
    assert [method for method, _, _ in store.requests()].count("GET") <= 4  # listings; the files are cached


@pytest.mark.long
def test_databases_and_user_columns(lake, url):
    lake.filter("num_objects > 0", name="all")
    train, val = lake.split("all", {"train": 0.5, "val": 0.5}, seed=0).values()
    assert {*train.scenario_ids, *val.scenario_ids} == {scenario.id for scenario in MADE}
    lake.tag_where("odd", "source_scenario_id LIKE '%1'")
    assert Lake(url).sql("SELECT sum(odd::INT) AS n FROM metadata")["n"][0] == 1
    lake.drop(val.name)
    lake.rename(train.name, name="learning")
    assert Lake(url).databases == ["all", "learning"]
    assert lake.database("learning").scenario_ids == train.scenario_ids
    with pytest.raises(DatabaseExists):
        lake.rename("learning", name="all")


@pytest.mark.long
def test_recreated_database_replaces_the_dropped_one(lake, url):
    reader = Lake(url)
    lake.filter("source_scenario_id = 's000001'", name="few")
    assert reader.database("few").scenario_ids == [MADE[1].id]
    lake.drop("few")
    lake.filter("source_scenario_id = 's000002'", name="few")
    assert reader.database("few").scenario_ids == Lake(url).database("few").scenario_ids == [MADE[2].id]


@pytest.mark.long
def test_pack_of_a_remote_lake(lake, tmp_path):
    lake.filter("source_scenario_id = 's000003'", name="one")
    packed = lake.pack("one", tmp_path / "pack")
    assert packed.num_scenarios == 1
    assert differences(ScenarioLoader(tmp_path / "pack", "one")[0], MADE[3]) == []


@pytest.mark.long
def test_sql_reads_only_the_lake(lake):
    for query in (
        "SELECT * FROM read_parquet('s3://bucket/elsewhere.parquet')",
        "SELECT * FROM read_text('/etc/hostname')",
        f"COPY (SELECT 1) TO '{lake.root}/x.parquet'",
    ):
        with pytest.raises(QueryError):
            lake.sql(query)
    lake.sql(ASKED)  # DuckDB can read URLs from here on
    for query in ("SELECT * FROM read_text('s3://bucket/x')", "SELECT * FROM read_text('/etc/hostname')"):
        with pytest.raises(QueryError):
            lake.sql(query)


@pytest.mark.long
def test_missing_file(lake):
    (name,) = lake.files.names(lake.paths("tracks")[0].removeprefix(f"{lake.root}/").rpartition("/")[0])
    lake.files.remove(name)
    with pytest.raises(LakeError, match="gone; `scenarionet maintain fsck`"):
        ScenarioLoader(Lake(lake.root))[0]
    with pytest.raises(LakeError, match="gone"):
        Lake(lake.root).sql(ASKED)


@pytest.mark.long
def test_urls_without_a_lake_are_refused(url, store):
    with pytest.raises(NoSuchSnapshot, match="no lake there"):
        Lake(url)
    with pytest.raises(LakeError, match="no such bucket"):
        Lake("s3://nobody-has-this/lake")
    with pytest.raises(LakeError, match="no such bucket"):
        open_files("s3://nobody-has-this/lake").publish_new("x", b"x")
    for odd in ("ftp://host/lake", "s3://", "file://elsewhere/lake"):
        with pytest.raises(LakeError, match="wanted a folder, s3://"):
            open_files(odd)


def test_url_of_a_folder(tmp_path):
    files = open_files(f"file://{tmp_path}/my%20lake")
    assert type(files) is LocalLakeFiles
    assert files.root == tmp_path / "my lake"


@pytest.mark.long
def test_local_lake_imports_no_object_store_package(tmp_path):
    write_lake(tmp_path / "lake", MADE[:1])
    code = """
import sys
sys.modules["obstore"] = sys.modules["fsspec"] = None
from scenarionet_data import Lake, ScenarioLoader
lake = Lake(sys.argv[1])
lake.filter("num_objects > 0", name="all")
print(len(ScenarioLoader(lake, "all")[0].tracks), lake.sql("SELECT count(*) AS n FROM tracks")["n"][0])
"""
    done = subprocess.run([sys.executable, "-c", code, tmp_path / "lake"], capture_output=True, text=True, check=False)
    assert done.stdout == "4 4\n", done.stderr


def test_missing_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "obstore", None)
    with pytest.raises(MissingDependency, match=r"pip install 'scenarionet-lake\[remote\]'"):
        Lake("s3://bucket/lake")
