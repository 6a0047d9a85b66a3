"""upgrade: afterwards every file of an older lake is sealed, and says what it said; a killed upgrade continues."""

from __future__ import annotations

import shutil
from pathlib import Path

import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner

from scenarionet_data import Lake, ScenarioLoader
from scenarionet_data.errors import LakeError
from scenarionet_data.maintenance import fsck, upgrade
from scenarionet_data.packs.verifying import verify_pack
from scenarionet_data.scenario.content_hash import content_hash
from scenarionet_data.storage.files.local import LocalLakeFiles
from scenarionet_data.storage.snapshots import snapshot as snapshots
from scenarionet_pipelines.cli import cli

pytestmark = pytest.mark.integration

GOLDEN = Path(__file__).parents[2] / "golden" / "lakes" / "format-1"


class Killed(BaseException):
    """Raised in place of a kill; derived from BaseException, so that no handler catches it."""


def copy_of(name: str, place: Path) -> Path:
    """A copy of a lake of an older version."""
    shutil.rmtree(place, ignore_errors=True)
    return Path(shutil.copytree(GOLDEN / name / "lake", place))


def contents(root: Path) -> dict[str, int]:
    """Content of every scenario."""
    return {scenario.id: content_hash(scenario) for scenario in ScenarioLoader(root)}


def check_upgraded(root: Path) -> None:
    found = fsck(root, is_deep=True)
    assert (found.problems, found.unsealed) == ((), ())
    lake = Lake(root)
    for table in ("metadata", "tracks", "lights", "maps"):
        for path in lake.paths(table):
            assert LocalLakeFiles(root).end(Path(path).relative_to(root).as_posix()).digest


@pytest.mark.parametrize("name", ["packed", "generated", pytest.param("recorded", marks=pytest.mark.long)])
def test_upgraded_lake_is_sealed_and_has_the_same_content(tmp_path, name):
    root = copy_of(name, tmp_path / "lake")
    before, published = contents(root), snapshots.published(LocalLakeFiles(root))
    assert len(fsck(root).unsealed) > 5
    done = upgrade(root)
    assert done.is_complete
    assert done.shards > 0
    assert done.sealed > 5
    check_upgraded(root)
    assert contents(root) == before
    if name == "packed":
        assert verify_pack(root).is_whole
    after = snapshots.published(LocalLakeFiles(root))
    assert {number: after[number] for number in published} == published
    again = upgrade(root)
    assert (again.is_complete, again.shards, again.sealed, again.snapshot) == (True, 0, 0, done.snapshot)


def test_open_readers_go_on(tmp_path):
    root = copy_of("packed", tmp_path / "lake")
    loader = ScenarioLoader(root)
    expected = content_hash(loader[0])
    upgrade(root)
    assert content_hash(loader[0]) == expected
    assert content_hash(loader[len(loader) - 1]) == content_hash(ScenarioLoader(root)[len(loader) - 1])


@pytest.mark.long
@pytest.mark.parametrize("name", ["packed", "recorded"])
def test_killed_upgrade_continues(tmp_path, monkeypatch, name):
    """Killed after every file that it publishes."""
    expected = contents(copy_of(name, tmp_path / "lake"))
    for step in range(1, 1000):
        root, count = copy_of(name, tmp_path / "lake"), 0
        with monkeypatch.context() as patch:

            def stopping(publish, last=step):
                def published(*words):
                    nonlocal count
                    done = publish(*words)
                    count += 1
                    if count == last:
                        raise Killed
                    return done

                return published

            for method in ("publish", "publish_new"):
                patch.setattr(LocalLakeFiles, method, stopping(getattr(LocalLakeFiles, method)))
            try:
                upgrade(root)
                break
            except Killed:
                pass
        assert fsck(root, is_deep=True).is_whole
        assert upgrade(root).is_complete
        check_upgraded(root)
        if step % 7 == 1:
            assert contents(root) == expected
    assert step > 10


def test_damaged_lake_is_not_upgraded(tmp_path):
    root = copy_of("packed", tmp_path / "lake")
    path = next(root.glob("tracks/**/*.parquet"))
    data = bytearray(path.read_bytes())
    data[100] ^= 1
    path.write_bytes(data)
    before = {path: path.read_bytes() for path in root.rglob("*") if path.is_file()}
    done = upgrade(root)
    assert [problem.file for problem in done.check.problems] == [path.relative_to(root).as_posix()]
    assert (done.is_complete, done.shards, done.sealed) == (False, 0, 0)
    assert {path: path.read_bytes() for path in root.rglob("*") if path.is_file()} == before
    result = CliRunner().invoke(cli, ["fsck", str(root), "--upgrade", "--quiet"])
    assert result.exit_code == 1
    assert "nothing was upgraded: repair these problems first" in result.output


def test_changed_value_in_unsealed_metadata_is_found_by_its_content_hash(tmp_path):
    root = copy_of("packed", tmp_path / "lake")
    path = next(root.glob("metadata/**/*.parquet"))
    rows = pq.ParquetFile(path).read()
    moved = rows.set_column(rows.column_names.index("origin_x"), rows.schema.field("origin_x"),
                            pc.add(rows["origin_x"], 1.0))  # fmt: skip
    with pq.ParquetWriter(path, moved.schema, store_schema=False) as writer:
        writer.add_key_value_metadata(rows.schema.metadata)
        writer.write_table(moved)
    found = fsck(root, is_deep=True)
    assert {problem.file for problem in found.problems} == {path.relative_to(root).as_posix()}
    assert "content differs from what was converted" in found.problems[0].reason
    assert not upgrade(root).is_complete


def test_file_damaged_after_the_check_is_reported(tmp_path, monkeypatch):
    def refuse(*words):
        raise LakeError("cannot be read")

    root = copy_of("packed", tmp_path / "lake")
    monkeypatch.setattr("scenarionet_data.storage.write.rewriting.rewrite", refuse)
    done = upgrade(root)
    assert not done.is_complete
    assert {reason for _, reason in done.failed} == {"cannot be read"}
    assert fsck(root, is_deep=True).is_whole


def test_command_upgrades_and_says_what_it_did(tmp_path):
    root = copy_of("packed", tmp_path / "lake")
    result = CliRunner().invoke(cli, ["fsck", str(root)])
    assert result.exit_code == 0
    assert f"scenarionet maintain fsck {root} --upgrade" in result.output.replace("\n", "")
    result = CliRunner().invoke(cli, ["fsck", str(root), "--upgrade", "--quiet"])
    assert result.exit_code == 0
    assert "other files" in result.output
    assert "--upgrade" not in CliRunner().invoke(cli, ["fsck", str(root)]).output
    result = CliRunner().invoke(cli, ["fsck", str(root), "--upgrade", "--repair"])
    assert result.exit_code == 2
