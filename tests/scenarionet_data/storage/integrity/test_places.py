"""Valid files of another lake under the same name are found, and lakes can be moved."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from scenarionet_data import Lake, ScenarioLoader
from scenarionet_data.errors import LakeError
from scenarionet_data.maintenance.fsck import fsck
from scenarionet_data.storage import evaluation_runs
from scenarionet_sim import evaluate
from tests.fixtures.lakes import write_lake
from tests.fixtures.scenarios import make_scenario

GOLDEN = Path(__file__).parents[3] / "golden" / "lakes" / "format-1"
BOUND = ["snapshots/00000001.json", "databases/all/1.parquet", "layers/mark/1.parquet", "results/a/run.json"]


def filled(root):
    """A lake with a database, a user column and a run."""
    write_lake(root, [make_scenario(seed) for seed in range(3)])
    lake = Lake(root)
    lake.filter("true", name="all")
    lake.tag("mark", dict.fromkeys(ScenarioLoader(lake).scenario_ids, 1))
    evaluation_runs.claim(lake.files, "a", ("results",), {"policy": "idm"})
    return root


@pytest.fixture(scope="module")
def two(tmp_path_factory):
    folder = tmp_path_factory.mktemp("lakes")
    return filled(folder / "a"), filled(folder / "b")


READ = {
    "snapshots": lambda lake: lake,
    "databases": lambda lake: lake.database("all"),
    "layers": lambda lake: lake.sql("SELECT mark FROM metadata"),
    "results": lambda lake: evaluation_runs.describe(lake.files, "a"),
}


@pytest.mark.parametrize("name", BOUND)
def test_file_of_another_lake_is_damage(two, tmp_path, name):
    mine, other = shutil.copytree(two[0], tmp_path / "a"), two[1]
    shutil.copyfile(other / name, mine / name)
    assert fsck(mine).problems[0].file == name
    with pytest.raises(LakeError, match="under this name in this lake"):
        READ[name.partition("/")[0]](Lake(mine))


@pytest.mark.parametrize("name", ["databases/all/1.parquet", "results/a/run.json"])
def test_file_of_an_older_lake_is_damage_in_a_new_one(two, tmp_path, name):
    mine = shutil.copytree(two[0], tmp_path / "a")
    older = GOLDEN / "generated" / "lake"
    shutil.copyfile(next(older.glob(name.replace("/a/", "/*/"))), mine / name)
    (problem,) = fsck(mine).problems
    assert problem.file == name
    assert "of another lake" in problem.reason


@pytest.mark.parametrize("folder", ["databases/again", "layers/again"])
def test_a_number_is_never_used_for_two_versions(folder, tmp_path):
    root = filled(tmp_path / "a")
    lake = Lake(root)

    def make(condition):
        if folder.startswith("layers"):
            lake.tag_where("again", condition)
        else:
            lake.filter(condition, name="again", allow_empty=True)

    make("true")
    older = (root / folder / "1.parquet").read_bytes()
    lake.untag("again") if folder.startswith("layers") else lake.drop("again")
    assert fsck(root).is_whole
    make("false")
    assert [path.name for path in (root / folder).iterdir()] == ["2.parquet"]
    (root / folder / "1.parquet").write_bytes(older)  # from a copy of the lake
    if folder.startswith("layers"):
        assert Lake(root).sql("SELECT bool_or(again) FROM metadata")[0, 0] is False
    else:
        assert len(Lake(root).database("again")) == 0
    (problem,) = fsck(root).problems
    assert problem.file == f"{folder}/1.parquet"
    assert problem.reason == "it was dropped, and has come back, for example from a copy"
    (root / folder / "2.parquet").write_bytes(older)
    assert f"{folder}/2.parquet" in {problem.file for problem in fsck(root).problems}


def test_renaming_does_not_use_a_number_again(tmp_path):
    root = filled(tmp_path / "a")
    lake = Lake(root)
    lake.rename("all", name="other")
    lake.rename("other", name="all")
    assert lake.database("all").reference == "all@2"
    assert fsck(root, is_deep=True).is_whole


def test_parts_of_an_earlier_run_of_the_same_name_are_damage(tmp_path):
    root = filled(tmp_path / "a")
    lake, kept = Lake(root), tmp_path / "kept"
    for _ in range(2):
        evaluate(root, policy="replay", name="again")
        if not kept.exists():
            (root / "results" / "again").rename(kept)
    name = "results/again/results/000000.parquet"
    shutil.copyfile(kept / "results" / "000000.parquet", root / name)
    with pytest.raises(LakeError, match=f"{name}.*under this name in this lake"):
        Lake(root).sql("SELECT * FROM results")
    (problem,) = fsck(root).problems
    assert problem.file == name
    shutil.rmtree(root / "results" / "again")
    kept.rename(root / "results" / "again")  # as a whole, it is what it was
    assert fsck(root, is_deep=True).is_whole
    assert len(lake.sql("SELECT * FROM results")) == 3


def test_tables_that_a_snapshot_lists_are_equal_in_all_lakes(two):
    listed = [path for path in two[0].rglob("*.parquet") if path.relative_to(two[0]).parts[0] in ("tracks", "metadata")]
    assert len(listed) > 1
    assert all(path.read_bytes() == (two[1] / path.relative_to(two[0])).read_bytes() for path in listed)


def test_a_lake_can_be_copied_and_moved(two, tmp_path):
    moved = shutil.copytree(two[0], tmp_path / "elsewhere")
    assert fsck(moved, is_deep=True).is_whole
    assert len(ScenarioLoader(moved, "all")) == 3


@pytest.mark.parametrize("change", [lambda text: json.dumps({**json.loads(text), "id": "x"}), lambda text: "{}"])
def test_a_lake_whose_id_changed_is_damaged(change, two, tmp_path):
    mine = shutil.copytree(two[0], tmp_path / "a")
    (mine / "lake.json").write_text(change((mine / "lake.json").read_text()))
    (problem,) = fsck(mine).problems
    assert problem.file == "lake.json" and problem.remedy.startswith("restore it from a copy of the lake")
    with pytest.raises(LakeError, match=r"lake\.json: damaged, it holds no id of a lake"):
        Lake(mine)


@pytest.mark.parametrize("other", ["databases/all/1.parquet", "results/*/results/*.parquet", "tracks/**/*.parquet"])
def test_metadata_of_an_older_lake_exchanged_with_another_table_is_damage(tmp_path, other):
    mine = Path(shutil.copytree(GOLDEN / "generated" / "lake", tmp_path / "lake"))
    name = Lake(mine).snapshot.metadata[0]
    shutil.copyfile(next(mine.glob(other)), mine / name)
    with pytest.raises(LakeError, match="it is a file of another table"):
        ScenarioLoader(mine)
    with pytest.raises(LakeError, match="it is a file of another table"):
        Lake(mine).sql("SELECT count(ego_distance) FROM metadata")


def test_a_snapshot_of_bytes_that_are_no_text_is_named(two, tmp_path):
    mine = shutil.copytree(two[0], tmp_path / "a")
    path = mine / "snapshots" / "00000001.json"
    path.write_bytes(path.read_bytes().replace(b"operation", b"op\xe3ration"))
    with pytest.raises(LakeError, match=r"00000001\.json: damaged, it is no snapshot \(its byte \d+ is of no text\)"):
        Lake(mine)
