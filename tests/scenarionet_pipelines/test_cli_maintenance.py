"""The verbs compact, vacuum and fsck."""

from __future__ import annotations

import json

import pytest

from scenarionet_data import Lake
from tests.scenarionet_pipelines.conftest import run

pytestmark = pytest.mark.integration


def test_compact_reports_its_work_and_then_nothing_to_do(lake, ok):
    assert ok("maintain", "compact", lake, "--dry-run") == "would rewrite 9 scenarios of 2 shards, in 1 bin\n"
    words = ok("maintain", "compact", lake, "--profile", "analytics", "--workers", "1")
    assert "rewritten  9 scenarios of 2 shards for analytics" in words
    assert "files      6 before, 3 now" in words
    assert f"scenarionet maintain vacuum {lake} --keep-last 1" in words
    assert (
        ok("maintain", "compact", lake, "--profile", "analytics")
        == "nothing to do: all files fit the profile analytics\n"
    )
    assert len(Lake(lake)) == 9


def test_compact_as_json(lake, as_json):
    planned = as_json("maintain", "compact", lake, "--where", "split=train", "--dry-run")
    assert planned == {"profile": "training", "bins": 1, "shards": 2, "scenarios": 9}
    done = as_json("maintain", "compact", lake)
    assert (done["shards"], done["files_before"], done["files_after"], done["failed"]) == (2, 6, 3, [])


@pytest.mark.long
def test_compact_on_a_cluster(lake, as_json):
    done = as_json(
        "maintain", "compact", lake, "--profile", "analytics", "--cluster", "local", "--workers", "2", "--quiet"
    )
    assert (done["shards"], done["files_after"], done["failed"]) == (2, 3, [])
    assert len(Lake(lake)) == 9


def test_compact_names_damaged_shards(lake):
    next(lake.glob("tracks/**/a-*")).write_bytes(b"PAR1")
    result = run("maintain", "compact", lake)
    assert result.exit_code == 1
    assert "failed     a and the rest of its file: cannot read" in result.stdout
    assert f"scenarionet maintain fsck {lake}" in result.stdout


def test_vacuum_deletes_only_with_yes(lake, ok, as_json):
    ok("filter", lake, "--name", "all")
    ok("maintain", "compact", lake)
    planned = ok("maintain", "vacuum", lake, "--keep-last", "1")
    assert "would expire  0 snapshots" in planned
    assert "needed        snapshot 1 by all@1; rebase it and drop that version" in planned
    ok("db", "drop", lake, "all")
    planned = ok("maintain", "vacuum", lake, "--keep-last", "1", "--dry-run")
    assert "would expire  1 snapshot: 1" in planned
    assert "would delete  2 files of tracks" in planned
    assert "add --yes to delete" in planned
    content = as_json("maintain", "vacuum", lake, "--keep-last", "1", "--yes")
    assert (content["is_done"], content["expired"], content["kept"]) == (True, [1], [2])
    assert content["tables"]["tracks"]["files"] == 2
    assert ok("maintain", "vacuum", lake, "--older-than", "0s").splitlines()[-1] == "nothing to do"


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ((), "--keep-last N, --older-than 30d, or both"),
        (("--keep-last", "0"), "Invalid value for '--keep-last'"),
        (("--older-than", "a month"), "--older-than expects a duration such as 30s"),
        (("--keep-last", "1", "--yes", "--dry-run"), "contradict each other"),
    ],
)
def test_vacuum_rejects_bad_options(lake, words, says):
    result = run("maintain", "vacuum", lake, *words)
    assert result.exit_code == 2
    assert says in result.stderr


def test_fsck_of_an_intact_lake(lake, ok, as_json):
    assert ok("maintain", "fsck", lake, "--deep") == "checked  9 files of 1 snapshot: intact\n"
    assert as_json("maintain", "fsck", lake)["is_whole"]


def test_fsck_names_file_reason_and_remedy_and_repairs(lake, raw, ok):
    path = next(lake.glob("tracks/**/a-*"))
    path.write_bytes(path.read_bytes()[:-1])
    result = run("maintain", "fsck", lake)
    assert result.exit_code == 1
    file, reason, remedy, verdict = result.stdout.splitlines()
    assert file == path.relative_to(lake).as_posix()
    assert "bytes long, was written with" in reason
    assert remedy.endswith(f"`scenarionet maintain fsck {lake} --repair` and convert again made v1 train: a.made")
    assert verdict == "checked  9 files of 1 snapshot: 1 problem"
    repaired = run("maintain", "fsck", lake, "--repair", "--json")
    assert repaired.exit_code == 1
    assert json.loads(repaired.stdout)["convert_again"] == ["a"]
    assert len(Lake(lake)) == 3
    run("convert", "tests.fixtures.made:Made", raw, lake)
    assert len(Lake(lake)) == 9
    ok("maintain", "fsck", lake, "--deep")
