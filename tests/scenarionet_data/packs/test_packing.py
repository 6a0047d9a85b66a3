"""A pack is a lake with only the members of a database."""

from __future__ import annotations

import shutil
import tarfile

import numpy as np
import pyarrow.parquet as pq
import pytest

from scenarionet_data import Lake, ScenarioLoader, convert
from scenarionet_data.errors import BadParameter, LakeError, NoSuchSnapshot
from scenarionet_data.packs.verifying import verify_pack
from scenarionet_data.quality.checks import run_checks
from scenarionet_data.query.members import StaleDatabaseWarning
from scenarionet_data.scenario.content_hash import content_hash
from tests.fixtures import made, made_city
from tests.fixtures.made import write_raw

pytestmark = pytest.mark.integration


@pytest.fixture(scope="module")
def _lake(tmp_path_factory):
    root = tmp_path_factory.mktemp("packed")
    raw = write_raw(root / "raw", {"a": range(70), "b": [100, 101, "7 invalid"], "c": [200]})
    convert(made.NAME, str(raw), root / "lake")
    lake = Lake(root / "lake")
    lake.tag("mark", {name: k for k, name in enumerate(lake.sql("SELECT scenario_id FROM metadata")["scenario_id"])})
    return root / "lake"


@pytest.fixture
def lake(_lake, tmp_path):
    return Lake(shutil.copytree(_lake, tmp_path / "lake"))


@pytest.fixture(scope="module")
def city(tmp_path_factory):
    root = tmp_path_factory.mktemp("packed_city")
    convert(made_city.NAME, str(write_raw(root / "raw", {"a": range(6), "b": range(10, 14)})), root / "lake")
    return Lake(root / "lake")


def listing(folder):
    return {path.relative_to(folder): (path.stat().st_size, path.stat().st_mtime_ns) for path in folder.rglob("*")}


def hashes(lake, scenarios):
    return [content_hash(scenario) for scenario in ScenarioLoader(lake, scenarios)]


@pytest.mark.parametrize(
    "where",
    [pytest.param("true", marks=pytest.mark.long), "hash(scenario_id) % 3 = 0", "ends_with(scenario_id, '100')"],
)
def test_pack_holds_only_the_members(where, lake, tmp_path):
    picked = lake.filter(where, name="picked")
    packed = lake.pack(picked, tmp_path / "pack")
    opened = Lake(tmp_path / "pack")
    assert packed.num_scenarios == len(opened) == len(picked)
    assert opened.databases == ["picked"]
    assert opened.database("picked").members.equals(picked.members)
    assert opened.database("picked").lineage == picked.lineage
    assert hashes(opened, "picked") == hashes(lake, "picked")
    everything = "SELECT * EXCLUDE (tracks_file, lights_file, maps_file, tracks_row_group, lights_row_group, "
    query = everything + "maps_row_group) FROM metadata ORDER BY scenario_id"
    assert opened.sql(query).equals(lake.restrict_to(picked).sql(query))
    for table in ("tracks", "lights", "maps"):
        rows = f"SELECT count(*) AS n FROM {table}"
        assert opened.sql(rows).equals(lake.restrict_to(picked).sql(rows))


def test_pack_passes_every_check_and_verification(lake, tmp_path):
    lake.pack(lake.filter("hash(scenario_id) % 2 = 0", name="half"), tmp_path / "pack")
    assert [r.name for r in run_checks(Lake(tmp_path / "pack")).results if r.is_hard and not r.is_met] == []
    found = verify_pack(tmp_path / "pack")
    assert (found.is_whole, found.references) == (True, ("half@1",))


@pytest.mark.long
def test_order_and_weights_are_kept_when_ids_are_reordered(lake, tmp_path):
    drawn = lake.sample(None, name="drawn", n=20, seed=3)
    lake.pack(drawn, tmp_path / "pack")
    assert ScenarioLoader(tmp_path / "pack", "drawn").scenario_ids == drawn.scenario_ids


@pytest.mark.long
def test_lineage_of_a_pack_names_its_origin_and_cannot_be_rebuilt(lake, tmp_path):
    lake.filter("num_objects > 0", name="all")
    lake.split("all", {"a": 0.5, "b": 0.5}, by="source_log")
    lake.sample("all_a", name="few", n=5)
    packed = lake.pack("few", tmp_path / "pack")
    opened = Lake(packed.path)
    (half,) = opened.lineage("few").parents
    (whole,) = half.parents
    assert (half.reference, half.is_here, half.lineage) == ("all_a@1", False, lake.database("all_a").lineage)
    assert (whole.reference, whole.is_here, whole.lineage) == ("all@1", False, lake.database("all").lineage)
    assert opened.lineage("few").is_here
    assert opened.databases == ["few"]
    for ask in (opened.rebuild, opened.rebase):
        with pytest.raises(LakeError, match=r"few@1 was packed: .* make it again in the lake it came from"):
            ask("few")
    again = Lake(opened.pack("few", tmp_path / "again").path)
    assert again.lineage("few") == opened.lineage("few")
    assert opened.rebuild(opened.filter("true", name="mine", database="few").reference).is_same
    assert opened.rebase("mine") == []


@pytest.mark.long
def test_user_column_version_used_by_the_query_is_included(lake, tmp_path):
    picked = lake.filter("mark % 5 = 1", name="picked")
    lake.tag("mark", dict.fromkeys(picked.scenario_ids, 0), replace=True)
    opened = Lake(lake.refresh().pack(picked, tmp_path / "pack").path)
    assert opened.user_columns == {"mark": 2}
    old = opened.at_snapshot(opened.snapshot.number, picked.lineage.user_columns)
    assert {mark % 5 for mark in old.sql("SELECT mark FROM metadata")["mark"]} == {1}
    assert verify_pack(tmp_path / "pack").is_whole


def test_user_columns_are_included_and_quarantine_is_empty(lake, tmp_path):
    picked = lake.filter("mark % 5 = 1", name="picked")
    lake.pack(picked, tmp_path / "pack")
    opened = Lake(tmp_path / "pack")
    assert opened.sql("SELECT * FROM quarantine").is_empty()
    marks = "SELECT scenario_id, mark FROM metadata ORDER BY scenario_id"
    assert opened.sql(marks).equals(lake.restrict_to(picked).sql(marks))
    (layer,) = (tmp_path / "pack" / "layers").rglob("*.parquet")
    assert pq.read_metadata(layer).num_rows == len(picked)


def test_description_lists_partial_shards(lake, tmp_path):
    lake.pack(lake.filter("ends_with(scenario_id, '100')", name="one"), tmp_path / "pack")
    (shard,) = Lake(tmp_path / "pack").sql("SELECT * FROM shards").to_dicts()
    assert (shard["items"], shard["num_scenarios"], shard["max_scenarios"]) == (["b.made"], 1, 1)
    assert shard["key"] not in lake.sql("SELECT key FROM shards")["key"].to_list()


@pytest.mark.long
def test_many_members_fill_files_of_64(lake, tmp_path):
    lake.pack(lake.filter("true", name="all"), tmp_path / "pack")
    sizes = [pq.read_metadata(path).num_row_groups for path in sorted((tmp_path / "pack/tracks").rglob("*.parquet"))]
    assert sizes == [64, 9]


@pytest.mark.long
def test_reading_a_pack_writes_nothing(lake, tmp_path):
    """As from read-only media: the same files, with the same modification times."""
    lake.pack(lake.filter("true", name="all"), tmp_path / "pack")
    before = listing(tmp_path / "pack")
    moved = shutil.move(tmp_path / "pack", tmp_path / "elsewhere")
    opened = Lake(moved)
    opened.sql("SELECT * FROM states ORDER BY x LIMIT 3")
    opened.mine("cut_in")
    opened.lineage("all")
    run_checks(opened)
    verify_pack(moved)
    assert len(ScenarioLoader(opened, "all").batch([2, 0])) == 2
    assert listing(tmp_path / "elsewhere") == before


@pytest.mark.long
def test_pack_of_a_pack_is_identical(lake, tmp_path):
    lake.pack(lake.filter("hash(scenario_id) % 2 = 0", name="half"), tmp_path / "once")
    Lake(tmp_path / "once").pack("half", tmp_path / "twice")
    assert hashes(Lake(tmp_path / "twice"), "half") == hashes(lake, "half")
    first, second = (sorted((tmp_path / name / "tracks").rglob("*.parquet")) for name in ("once", "twice"))
    assert [path.read_bytes() for path in first] == [path.read_bytes() for path in second]


@pytest.mark.long
def test_tar_unpacks_to_the_pack(lake, tmp_path):
    lake.filter("hash(scenario_id) % 2 = 0", name="half")
    lake.pack("half", tmp_path / "half.tar", tar=True)
    lake.pack("half", tmp_path / "folder")
    assert verify_pack(tmp_path / "half.tar").is_whole
    with tarfile.open(tmp_path / "half.tar") as archive:
        archive.extractall(tmp_path / "there", filter="data")
    assert hashes(Lake(tmp_path / "there/half"), "half") == hashes(lake, "half")
    own = "databases", "layers"  # whose seals name their lake
    one, other = (
        {p.relative_to(f): p.read_bytes() for p in f.rglob("*.parquet") if p.relative_to(f).parts[0] not in own}
        for f in (tmp_path / "there/half", tmp_path / "folder")
    )
    assert one == other
    assert sorted(p.name for p in tmp_path.iterdir()) == ["folder", "half.tar", "lake", "there"]


def test_changed_members_are_packed_from_their_own_snapshot(tmp_path):
    raw, root = write_raw(tmp_path / "raw", {"a": [1, 2], "b": [3]}), tmp_path / "lake"
    convert(made.NAME, str(raw), root, options=made.MadeOptions(num_objects=2))
    then = Lake(root)
    then.filter("true", name="old")
    wanted = hashes(then, "old")
    (raw / "a.made").write_text("1")
    convert(made.NAME, str(raw), root, options=made.MadeOptions(num_objects=3), replace=True)
    with pytest.warns(StaleDatabaseWarning):
        Lake(root).pack("old", tmp_path / "pack")
    opened = Lake(tmp_path / "pack")
    assert hashes(opened, "old") == wanted
    assert opened.snapshot.number == then.snapshot.number
    assert verify_pack(tmp_path / "pack").is_whole


# --- shared maps ------------------------------------------------------------------------------------------------


@pytest.mark.long
def test_only_tiles_used_by_members_are_packed(city, tmp_path):
    one = city.filter("ends_with(scenario_id, '3')", name="some")
    city.pack(one, tmp_path / "pack")
    opened = Lake(tmp_path / "pack")
    assert hashes(opened, "some") == hashes(city, "some")
    for found, wanted in zip(ScenarioLoader(opened, "some"), ScenarioLoader(city, "some"), strict=True):
        assert list(found.map.ids) == list(wanted.map.ids)
        assert np.array_equal(found.map.polyline.values, wanted.map.polyline.values)
    tiles = [pq.read_metadata(lake.paths("maps")[0]).num_row_groups for lake in (opened, city)]
    assert 0 < tiles[0] < tiles[1] / 4
    assert [result.name for result in run_checks(opened).results if not result.is_met] == []
    assert verify_pack(tmp_path / "pack").is_whole


# --- invalid input ----------------------------------------------------------------------------------------------


def test_existing_output_is_not_overwritten(lake, tmp_path):
    lake.filter("true", name="all")
    (tmp_path / "there").mkdir()
    with pytest.raises(BadParameter, match="choose another name"):
        lake.pack("all", tmp_path / "there")
    assert list((tmp_path / "there").iterdir()) == []


def test_database_without_members_is_refused(lake, tmp_path):
    lake.filter("false", name="none", allow_empty=True)
    with pytest.raises(BadParameter, match="nothing to pack"):
        lake.pack("none", tmp_path / "pack")


def test_damaged_files_are_not_packed(lake, tmp_path):
    lake.filter("true", name="all")
    path = lake.files.path(lake.paths("tracks")[0])
    x = next(
        c for k in range(99) if (c := pq.read_metadata(path).row_group(9).column(k)).path_in_schema.startswith("x.")
    )
    content = bytearray(path.read_bytes())
    content[x.data_page_offset + x.total_compressed_size - 200] ^= 1
    path.write_bytes(content)
    with pytest.raises(LakeError, match=r"is damaged in the lake|cannot read"):
        lake.pack("all", tmp_path / "pack")
    assert not (tmp_path / "pack").exists()


def test_lake_with_a_missing_file_leaves_no_partial_pack(lake, tmp_path):
    lake.filter("true", name="all")
    lake.files.path(lake.paths("lights")[0]).unlink()
    with pytest.raises(LakeError, match="cannot read"):
        lake.pack("all", tmp_path / "pack")
    assert [path.name for path in tmp_path.iterdir()] == ["lake"]
    with pytest.raises(NoSuchSnapshot):
        Lake(tmp_path / "pack")
