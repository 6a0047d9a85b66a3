"""Verification names every broken file of a pack."""

from __future__ import annotations

import shutil

import pyarrow as pa
import pytest

from scenarionet_data import Lake, convert
from scenarionet_data.errors import BadParameter
from scenarionet_data.packs.verifying import verify_pack
from scenarionet_data.storage.integrity.snapshot_checks import verify
from scenarionet_data.storage.snapshots import snapshot as snapshots
from scenarionet_data.storage.write.table_file import publish_table
from tests.fixtures import made_city
from tests.fixtures.made import write_raw

pytestmark = pytest.mark.integration

KINDS = ("tracks", "maps", "metadata", "snapshots/0", "snapshots/manifest", "databases", "layers")


@pytest.fixture(scope="module")
def _lake(tmp_path_factory):
    root = tmp_path_factory.mktemp("broken")
    convert(made_city.NAME, str(write_raw(root / "raw", {"a": range(3)})), root / "lake")
    lake = Lake(root / "lake")
    lake.tag_where("far", "ego_distance > 10")
    lake.filter("true", name="all")
    lake = lake.refresh()  # with its user column
    lake.pack("all", root / "pack")
    lake.pack("all", root / "pack.tar", tar=True)
    return root


@pytest.fixture
def pack(_lake, tmp_path):
    return shutil.copytree(_lake / "pack", tmp_path / "pack")


@pytest.fixture
def lake(_lake, tmp_path):
    return Lake(shutil.copytree(_lake / "lake", tmp_path / "lake"))


def file_of(pack, kind):
    names = (path.relative_to(pack).as_posix() for path in sorted(pack.rglob("*")) if path.is_file())
    return next(name for name in names if name.startswith(kind))


def damaged(path):
    return {damage.file: damage.reason for damage in verify_pack(path).damages}


def flip(path, at=None):
    content = bytearray(path.read_bytes())
    content[len(content) // 2 if at is None else at] ^= 16
    path.write_bytes(content)


@pytest.mark.parametrize("kind", KINDS)
def test_flipped_bit(kind, pack):
    name = file_of(pack, kind)
    flip(pack / name)
    assert "another checksum" in damaged(pack)[name]


@pytest.mark.parametrize("kind", KINDS)
def test_truncated_file(kind, pack):
    name = file_of(pack, kind)
    (pack / name).write_bytes((pack / name).read_bytes()[:-10])
    assert list(damaged(pack)) == [name]


@pytest.mark.parametrize("kind", KINDS)
def test_missing_file(kind, pack):
    name = file_of(pack, kind)
    (pack / name).unlink()
    assert damaged(pack) == {name: "gone"}


def test_two_broken_files_are_both_named(pack):
    names = {file_of(pack, kind) for kind in ("tracks", "maps")}
    for name in names:
        flip(pack / name)
    assert set(damaged(pack)) == names


def test_missing_or_empty_checksums(pack):
    (pack / "SHA256SUMS").write_text("")
    assert damaged(pack) == {"SHA256SUMS": "lists no files, or is damaged"}
    (pack / "SHA256SUMS").unlink()
    assert damaged(pack) == {"SHA256SUMS": "gone"}


@pytest.mark.parametrize("kind", ["metadata", "snapshots/manifest", "databases"])
def test_checksums_with_a_missing_line(kind, pack):
    lines = (pack / "SHA256SUMS").read_text().splitlines(keepends=True)
    (pack / "SHA256SUMS").write_text("".join(line for line in lines if f"  {kind}" not in line))
    assert "does not list" in damaged(pack)["SHA256SUMS"]


def test_checksums_with_paths_outside_the_pack(pack, tmp_path):
    (tmp_path / "secret").write_text("x")
    with (pack / "SHA256SUMS").open("a") as file:
        file.write(f"{'0' * 64}  ../secret\n{'0' * 64}  /etc/hostname\n")
    assert damaged(pack) == {}


def test_damaged_tar(_lake, tmp_path):
    content = (_lake / "pack.tar").read_bytes()
    (tmp_path / "pack.tar").write_bytes(content[: len(content) // 3])
    assert "cannot be unpacked" in damaged(tmp_path / "pack.tar")["pack.tar"]
    (tmp_path / "no.tar").write_bytes(b"x" * 3000)
    assert "cannot be unpacked" in damaged(tmp_path / "no.tar")["no.tar"]
    name = next(
        line.split("  ")[1] for line in (_lake / "pack/SHA256SUMS").read_text().splitlines() if "tracks" in line
    )
    at = content.index((_lake / "pack" / name).read_bytes())
    (tmp_path / "flipped.tar").write_bytes(content)
    flip(tmp_path / "flipped.tar", at + 1000)
    assert list(damaged(tmp_path / "flipped.tar")) == [name]


def test_other_folders_and_files_are_refused(tmp_path):
    for path in (tmp_path, tmp_path / "nowhere"):
        with pytest.raises(BadParameter, match=r"no pack|no such pack"):
            verify_pack(path)


# --- references, in any lake --------------------------------------------------------------------------------------


def rewritten(lake, change):
    """The lake's snapshot with other rows of metadata, as a faulty writer would leave them."""
    (name,) = lake.snapshot.metadata
    rows = change(lake.files.read(name).to_pylist())
    publish_table(lake.files, "metadata", rows, {}, name)
    return {damage.file: damage.reason for damage in verify(lake.files, lake.snapshot)}


def changed(**values):
    return lambda rows: [rows[0] | values, *rows[1:]]


def test_intact_lake_has_no_damage(lake):
    assert rewritten(lake, list) == {}


@pytest.mark.parametrize(
    "values", [{"tracks_row_group": 3}, {"tracks_row_group": -1}, {"tracks_first_row": 1}, {"tracks_num_rows": 99}]
)
def test_missing_rows(values, lake):
    found = rewritten(lake, changed(**values))
    (name,) = (path.relative_to(lake.root).as_posix() for path in (lake.root / "tracks").rglob("*.parquet"))
    assert set(found) == {name}
    assert "does not hold the" in found[name]


def test_file_not_listed_by_any_shard(lake):
    found = rewritten(lake, changed(tracks_file="tracks/other.parquet"))
    assert "no shard of the snapshot lists it" in found["tracks/other.parquet"]


def test_missing_map(lake):
    found = rewritten(lake, changed(map_id="atlantis"))
    assert list(found.values()) == ["no map 'atlantis', which scenarios are windows on"]


def test_missing_scenarios(lake):
    found = rewritten(lake, lambda rows: rows[1:])
    assert "2 scenarios, its shards have 3" in found.values()
    assert any("15 rows, but its scenarios have 10 of them" in reason for reason in found.values())


def test_members_missing_from_the_pack(pack):
    """A database of other scenarios, with matching checksums."""
    from scenarionet_data.databases import writer
    from scenarionet_data.packs import verifying

    opened = Lake(pack)
    found = opened.database("all")
    strange = pa.array(["nobody", *found.scenario_ids[1:]])
    members = found.members.set_column(0, found.members.schema.field(0), strange)
    writer.save(opened.files, "strange", members, found.lineage, replace=False)
    (damage,) = verifying._lost_members(opened.files, ["strange@1", "all@1"])
    assert (damage.file, damage.reason) == (
        "databases/strange/1.parquet",
        "1 of 3 members are not in the pack, for example nobody",
    )


def test_empty_snapshot_is_valid(lake):
    assert list(verify(lake.files, snapshots.EMPTY)) == []
