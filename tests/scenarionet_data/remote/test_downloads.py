"""Worker downloads: only the files of a shard, each fetched once, never partially."""

from __future__ import annotations

import tempfile
import threading
from dataclasses import replace
from pathlib import Path

import pytest

from scenarionet_data import Lake, convert
from scenarionet_data.conversion.remote_raw.downloads import local_copy, remove_downloads
from scenarionet_data.errors import LakeError, SourceNotFound
from scenarionet_data.ingest.shard import RawItem, Shard
from scenarionet_data.storage.files.object_store import ObjectStore
from tests.fixtures.buckets import fetched, put, upload
from tests.fixtures.made import NAME, Made, MadeOptions, write_raw
from tests.fixtures.object_store import BUCKET

pytestmark = pytest.mark.long


class WithTables(Made):
    """Every shard needs the tables, and the files in ``maps`` listed by ``maps/index``."""

    def files(self, shard):
        yield [*(item.name for item in shard.items), "tables/*", "maps/index", "nowhere"]
        yield (Path(shard.root) / "maps" / "index").read_text().split()


FILES = {
    "a.made": b"1", "b.made": b"2", "c.made": b"3", "tables/one.json": b"[1]", "tables/two.json": b"[2]",
    "tables/more/three": b"", "maps/index": b"maps/x", "maps/x": b"x", "maps/y": b"y",
}  # fmt: skip
TABLES = {"tables/one.json", "tables/two.json", "maps/index", "maps/x"}


@pytest.fixture
def place(store, request):
    """A URL with these files under a prefix named after the test."""
    yield put(FILES, request.node.name)
    remove_downloads()


def shard(place, *names):
    items = tuple(RawItem(f"{name}.made", "") for name in names)
    return Shard("made", "v1", "train", "-".join(names), place, items, MadeOptions())


def there(here):
    root = Path(here.root)
    return {path.relative_to(root).as_posix() for path in root.rglob("*") if path.is_file()}


def test_shard_downloads_only_the_files_it_needs(place, store, request):
    prefix = request.node.name
    store.set()
    with local_copy(WithTables(), shard(place, "a", "b")) as here:
        assert there(here) == {"a.made", "b.made"} | TABLES
        assert [path.read_bytes() for path in here.paths] == [b"1", b"2"]
    assert fetched(store, prefix) == dict.fromkeys({"a.made", "b.made", "nowhere"} | TABLES, 1)
    states = {name: (Path(here.root) / name).stat() for name in TABLES}
    with local_copy(WithTables(), shard(place, "c")) as again:
        assert there(again) == {"c.made"} | TABLES
        assert {name: (Path(again.root) / name).stat() for name in TABLES} == states
    assert fetched(store, prefix) == {"c.made": 1, "nowhere": 1}
    remove_downloads()
    assert not Path(here.root).exists()


def test_changed_file_is_fetched_again(place, store, request):
    with local_copy(WithTables(), shard(place, "a")):
        pass
    put({"tables/one.json": b"[3]", "maps/index": b"maps/y"}, request.node.name)
    ObjectStore(place).delete(["tables/two.json"])
    with local_copy(WithTables(), shard(place, "a")) as here:
        assert there(here) == {"a.made", "tables/one.json", "maps/index", "maps/y"}
        assert (Path(here.root) / "tables/one.json").read_bytes() == b"[3]"


def test_locally_deleted_file_is_fetched_again(place):
    with local_copy(WithTables(), shard(place, "a")) as here:
        (Path(here.root) / "maps" / "x").unlink()
    with local_copy(WithTables(), shard(place, "a")) as here:
        assert there(here) == {"a.made"} | TABLES


def test_file_deleted_after_listing(place):
    with (
        pytest.raises(SourceNotFound, match=f"{place}/z.made: deleted since it was listed"),
        local_copy(WithTables(), shard(place, "a", "z")),
    ):
        pass


def test_errors_name_the_store(place):
    with pytest.raises(ValueError, match=f"^{place}/a.made is odd$"), local_copy(Made(), shard(place, "a")) as here:
        raise ValueError(f"{here.paths[0]} is odd")


def test_interrupted_download_is_not_used(place, monkeypatch):
    whole, interrupted = ObjectStore.download, threading.Event()

    def half(self, name, path):
        if name.endswith("two.json") and not interrupted.is_set():
            path.write_bytes(b"[")
            interrupted.set()
            raise KeyboardInterrupt
        return whole(self, name, path)

    monkeypatch.setattr(ObjectStore, "download", half)
    with pytest.raises(KeyboardInterrupt), local_copy(WithTables(), shard(place, "a")):
        pass
    with local_copy(WithTables(), shard(place, "a")) as here:
        assert (Path(here.root) / "tables" / "two.json").read_bytes() == b"[2]"


def test_temporary_store_errors_are_retried(place, store, monkeypatch):
    monkeypatch.setenv("SCENARIONET_PATIENCE", "0.2")
    store.set(failures=100, status=500, part="tables/one", method="GET")
    with pytest.raises(LakeError, match="answers 500"), local_copy(WithTables(), shard(place, "a")):
        pass
    store.set()
    with local_copy(WithTables(), shard(place, "a")) as here:
        assert there(here) == {"a.made"} | TABLES


def test_concurrent_shards_do_not_interfere(place):
    with local_copy(WithTables(), shard(place, "a")) as one, local_copy(WithTables(), shard(place, "b")) as other:
        assert there(one) - TABLES == {"a.made"}
        assert there(other) - TABLES == {"b.made"}
        assert one.root != other.root


def test_shard_of_a_whole_bucket(place, request):
    moved = replace(shard(f"s3://{BUCKET}"), items=(RawItem(f"{request.node.name}/a.made", ""),))
    with local_copy(Made(), moved) as here:
        assert here.paths[0].read_bytes() == b"1"


def test_leftovers_of_a_killed_worker_are_removed_with_the_run(store, tmp_path, monkeypatch):
    (tmp_path / "temporary").mkdir()
    monkeypatch.setenv("TMPDIR", str(tmp_path / "temporary"))
    monkeypatch.setattr(tempfile, "tempdir", None)
    place = upload(write_raw(tmp_path / "raw", {"s0": ["1 deadly"], "s1": [2], "s2": [3]}), "deadly")
    how = {"options": MadeOptions(num_objects=2), "workers": 2}
    ((shard, _),) = convert(NAME, place, tmp_path / "lake", **how).failed
    assert shard == "s0"
    assert not list((tmp_path / "temporary").glob("scenarionet-raw-*"))
    put({"s0.made": b"1"}, "deadly")
    convert(NAME, place, tmp_path / "lake", **how)
    assert len(Lake(tmp_path / "lake")) == 3
    assert not list((tmp_path / "temporary").glob("scenarionet-raw-*"))
