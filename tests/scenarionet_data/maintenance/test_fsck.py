"""fsck: every kind of damage is found, located and explained; an intact lake has no problems."""

from __future__ import annotations

import re
import shutil

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner

from scenarionet_data import Lake
from scenarionet_data.errors import NoSuchSnapshot, ScenarioNetError
from scenarionet_data.maintenance import compact, fsck, repair, vacuum
from scenarionet_data.storage import evaluation_runs
from scenarionet_data.storage.files.local import LocalLakeFiles
from scenarionet_data.storage.integrity import seals
from scenarionet_data.storage.snapshots import commit as commits
from scenarionet_data.storage.snapshots import metadata_files
from scenarionet_data.storage.snapshots import snapshot as snapshots
from scenarionet_pipelines.cli import cli
from tests.fixtures.lakes import write_shard
from tests.fixtures.made import write_raw
from tests.fixtures.scenarios import make_scenario
from tests.scenarionet_data.maintenance.conftest import check_whole, content, convert_to

pytestmark = pytest.mark.integration


def found(root, *, is_deep=True):
    """Reasons by file."""
    return {problem.file: problem.reason for problem in fsck(root, is_deep=is_deep).problems}


def file_of(root, pattern):
    path = sorted(root.glob(pattern))[0]
    return path, path.relative_to(root).as_posix()


def change_a_byte(path, position=60):
    content = bytearray(path.read_bytes())
    content[position] ^= 1
    path.write_bytes(content)


# --- files ----------------------------------------------------------------------------------------------


def test_intact_lake_has_no_problems_and_reports_progress(root):
    Lake(root).filter(name="all")
    compact(root, "analytics")
    told = []
    result = fsck(root, is_deep=True, workers=2, on_progress=lambda *counts: told.append(counts))
    assert (result.is_whole, result.snapshots, result.num_files, result.notes) == (True, (1, 2), 23, ())
    assert told == [(done, 23, 0) for done in range(1, 24)]


@pytest.mark.parametrize("table", ["tracks", "maps"])
def test_changed_byte_is_found_by_deep_check(root, table):
    path, name = file_of(root, f"{table}/**/*.parquet")
    change_a_byte(path)
    assert found(root, is_deep=False) == {}
    assert found(root) == {name: "its bytes differ from those written: another checksum"}


@pytest.mark.parametrize("pattern", ["tracks/**/*.parquet", "metadata/**/*.parquet", "snapshots/manifest-*"])
@pytest.mark.parametrize("damage", ["gone", "cut", "garbage"])
def test_missing_and_truncated_files_are_found(root, pattern, damage):
    path, name = file_of(root, pattern)
    if damage == "gone":
        path.unlink()
    else:
        path.write_bytes(path.read_bytes()[:-9] if damage == "cut" else bytes(path.stat().st_size))
    (problem,) = fsck(root).problems if damage != "garbage" or "tracks" not in pattern else fsck(root).problems[:1]
    assert problem.file == name
    assert "restore it from a copy" in problem.remedy


def test_superseded_metadata_is_checked_too(root, monkeypatch):
    """Merged metadata supersedes it, but replacing a shard falls back to it."""
    monkeypatch.setattr(metadata_files, "MAX_METADATA_FILES", 2)
    monkeypatch.setattr(metadata_files, "MERGED_FILES", 1)
    commits.consolidate(LocalLakeFiles(root))
    vacuum(root, keep_last=1)
    path, name = file_of(root, "metadata/**/s2-*")
    path.write_bytes(b"PAR1")
    assert list(found(root)) == [name]


def test_invalid_snapshot_file_is_found(raw, root):
    convert_to(write_raw(raw, {"n": [77]}), root)
    (root / snapshots.file_name(1)).write_bytes(b"{")
    (problem,) = fsck(root).problems
    assert problem.file == "snapshots/00000001.json"
    assert "damaged, it is no snapshot" in problem.reason
    assert "or remove it" in problem.remedy


def test_folder_without_lake_raises_error(raw):
    with pytest.raises(NoSuchSnapshot, match="no lake there"):
        fsck(raw)


def test_empty_lake_has_no_problems(tmp_path):
    (tmp_path / "snapshots").mkdir()
    assert fsck(tmp_path).is_whole


# --- references -----------------------------------------------------------------------------------------


def rewritten(root, change):
    """The lake with its first metadata file rewritten, and its size and checksum updated to match."""
    path, name = file_of(root, "metadata/**/*.parquet")
    table = pq.ParquetFile(path).read()
    changed = pa.Table.from_pylist(change(table.to_pylist()), schema=table.schema)
    with pq.ParquetWriter(path, changed.schema, store_schema=False) as writer:
        writer.add_key_value_metadata(table.schema.metadata)
        writer.write_table(changed)
    seals.seal(path, seals.Place(name))
    return found(root)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"tracks_row_group": 7}, "row group 7 does not hold the 2 rows of made/v1/s000000"),
        ({"tracks_first_row": 1}, "row group 0 does not hold the 2 rows of made/v1/s000000"),
        ({"tracks_row_group": 1}, "rows of another scenario where made/v1/s000000 should be"),
        ({"tracks_num_rows": 1}, "4 rows, but its scenarios have 3 of them"),
        ({"tracks_file": "tracks/x.parquet"}, "holds made/v1/s000000, but no shard of the snapshot lists it"),
    ],
)
def test_wrong_addresses_are_found(root, change, reason):
    assert reason in rewritten(root, lambda rows: [rows[0] | change, *rows[1:]]).values()


def test_orphaned_file_is_found(root):
    """A shard with the scenarios of one of its files removed."""
    reasons = rewritten(root, lambda rows: [])
    assert "no scenario has its rows here" in reasons.values()
    assert "6 scenarios, its shards have 8" in reasons.values()


# --- files outside snapshots ----------------------------------------------------------------------------


def test_damaged_databases_user_columns_and_runs_are_found(root):
    lake = Lake(root)
    lake.tag_where("odd", "scenario_id LIKE '%1'")
    Lake(root).filter("odd", name="odds")
    lake.filter(name="all")
    (root / "results/mine/results").mkdir(parents=True)
    (root / "results/mine/run.json").write_text("{")
    (root / "results/mine/results/000000.parquet").write_bytes(b"x")
    (root / "databases/all/1.parquet").write_bytes(b"PAR1")
    (root / "layers/odd/1.parquet").unlink()
    problems = {problem.file: problem for problem in fsck(root).problems}
    assert set(problems) == {
        "databases/all/1.parquet",
        "databases/odds/1.parquet",
        "results/mine/run.json",  # whose id the seals of the run's other files cover: they are not read
    }
    assert problems["databases/odds/1.parquet"].reason == "it was made with the column odd@1, which is gone"
    assert "simulate again" in problems["results/mine/run.json"].remedy


def test_database_with_changed_members_needs_its_snapshot(raw, root):
    Lake(root).filter(name="old")
    convert_to(write_raw(raw, {"s0": [0, 55]}), root, replace=True)
    assert found(root) == {}
    snapshots.expire(LocalLakeFiles(root), 1)
    assert found(root) == {
        "databases/old/1.parquet": "members have changed, and snapshot 1, which it was made on, is gone"
    }


def test_leftover_files_are_notes_not_problems(root):
    write_shard(root, [make_scenario(500, num_objects=1)], name="uncommitted")
    (root / ".tmp").mkdir(exist_ok=True)
    (root / ".tmp" / "1-x").write_bytes(b"half")
    result = fsck(root)
    assert result.is_whole
    unnamed, temporary = result.notes
    assert (unnamed.num_files, temporary.num_files, temporary.size) == (4, 1, 4)


# --- repair ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("profile", [None, pytest.param("training", marks=pytest.mark.long), "analytics"])
def test_repair_and_conversion_restore_everything(raw, root, profile):
    before = content(Lake(root))
    if profile:
        compact(root, profile)
        vacuum(root, keep_last=1)
    path, _ = file_of(root, "tracks/**/*.parquet")
    change_a_byte(path)
    result = fsck(root, is_deep=True)
    (problem,) = result.problems
    assert "--repair` and convert again made v1 train: s" in problem.remedy
    again = repair(root, result)
    assert again == (["s0", "s1", "s2", "s3"] if profile else ["s0"])
    vacuum(root, keep_last=1)
    check_whole(root)
    convert_to(raw, root)
    assert content(Lake(root)) == before
    check_whole(root)


def test_repair_merges_metadata_again(root, monkeypatch):
    monkeypatch.setattr(metadata_files, "MAX_METADATA_FILES", 2)
    monkeypatch.setattr(metadata_files, "MERGED_FILES", 1)
    commits.consolidate(LocalLakeFiles(root))
    path, _ = file_of(root, "metadata/**/merged-*")
    whole = path.read_bytes()
    path.write_bytes(b"PAR1")
    with pytest.raises(ScenarioNetError):
        content(Lake(root))
    result = fsck(root)
    (problem,) = result.problems
    assert "merges it again" in problem.remedy
    assert repair(root, result) == []
    assert path.read_bytes() == whole
    check_whole(root)


def test_remedy_says_when_only_older_snapshots_need_the_file(root):
    compact(root, "analytics")
    path, _ = file_of(root, "tracks/**/s0-*")
    path.unlink()
    result = fsck(root)
    (problem,) = result.problems
    assert "the newest snapshot does not need it" in problem.remedy
    vacuum(root, keep_last=1)
    check_whole(root)


@pytest.mark.long
@pytest.mark.parametrize("kind", ["databases", "layers", "results", "snapshots"])
def test_remedy_of_other_files_works(raw, root, kind):
    lake = Lake(root)
    lake.tag_where("odd", "scenario_id LIKE '%1'")
    lake.refresh().filter("odd", name="odds")
    lake.filter(name="all")
    evaluation_runs.claim(lake.files, "mine", ("results",), {}).publish(0, {"results": []})
    convert_to(write_raw(raw, {"n": [77]}), root)
    pattern = {"databases": "all/1.parquet", "layers": "odd/1.parquet", "results": "mine/run.json"}
    path = root / kind / pattern.get(kind, "00000002.json")
    change_a_byte(path, position=20)
    result = fsck(root, is_deep=True)
    assert [problem.file for problem in result.problems] == [path.relative_to(root).as_posix()]
    (problem,) = result.problems
    if kind == "results":
        assert "remove the run's folder" in problem.remedy
        shutil.rmtree(path.parent)
    elif kind == "snapshots":
        assert "or remove it: the previous snapshot has everything" in problem.remedy
        path.unlink()
    else:
        (command,) = re.findall("`scenarionet (.*? --force)`", problem.remedy)
        result = CliRunner().invoke(cli, command.replace("LAKE", str(root)).split())
        assert result.exit_code == 0, result.output
    left = fsck(root, is_deep=True).problems
    assert [problem.reason for problem in left] == (
        ["it was made with the column odd@1, which is gone"] if kind == "layers" else []
    )


def test_repair_removes_a_shard_whose_metadata_is_damaged_as_well_as_its_merged_copy(raw, root, monkeypatch):
    monkeypatch.setattr(metadata_files, "MAX_METADATA_FILES", 2)
    monkeypatch.setattr(metadata_files, "MERGED_FILES", 1)
    commits.consolidate(LocalLakeFiles(root))
    before = content(Lake(root))
    for pattern in ("metadata/**/merged-*", "metadata/**/s2-*"):
        change_a_byte(file_of(root, pattern)[0])
    result = fsck(root, is_deep=True)
    assert len(result.problems) == 2
    assert repair(root, result) == ["s2"]
    convert_to(raw, root)
    vacuum(root, keep_last=1)
    check_whole(root)
    assert content(Lake(root)) == before


@pytest.mark.parametrize("pattern", ["metadata/**/n-*", "tracks/**/n-*"])
def test_damaged_file_that_is_not_committed_yet_is_not_adopted(raw, root, monkeypatch, pattern):
    """A job was killed before its commit; its files were damaged afterwards."""
    write_raw(raw, {"n": [77]})
    with monkeypatch.context() as patch:
        patch.setattr(commits, "commit", lambda *words, **how: pytest.fail("killed"))
        with pytest.raises(BaseException, match="killed"):
            convert_to(raw, root)
    change_a_byte(file_of(root, pattern)[0])
    convert_to(raw, root)
    check_whole(root)
    assert len(Lake(root)) == 9
