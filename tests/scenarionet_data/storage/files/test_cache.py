"""The local cache of object-store files: keyed by etag, least recently used files evicted when space runs out."""

from __future__ import annotations

import os
import time

import pytest

from scenarionet_data.errors import LakeError
from scenarionet_data.storage.files import cache, object_store, store_client
from scenarionet_data.storage.files.cache import LocalCopies, folder_of, make_room


@pytest.fixture
def copies(tmp_path, monkeypatch):
    monkeypatch.setenv("SCENARIONET_CACHE", str(tmp_path))
    return LocalCopies(folder_of("s3://bucket/lake"))


def add(copies, name, mark="", size=10, hours=0.0):
    temporary = copies.folder / "new"
    temporary.parent.mkdir(parents=True, exist_ok=True)
    temporary.write_bytes(b"x" * size)
    path = copies.add(temporary, name, mark)
    used = time.time() - 3600 * hours
    os.utime(path, (used, used))
    return path


def test_content_is_keyed_by_etag(copies):
    path = add(copies, "databases/a/1.parquet", "one")
    assert copies.find("databases/a/1.parquet", "one") == path
    assert copies.find("databases/a/1.parquet", "other") is None
    assert path.as_posix().endswith("databases/a/1.parquet")


def test_lakes_do_not_share_cached_files(copies):
    assert folder_of("s3://bucket/lake") != folder_of("s3://bucket/lake2")


def test_least_recently_used_files_are_evicted(copies):
    old = [add(copies, f"metadata/{k}", hours=10 - k) for k in range(6)]
    assert copies.find("metadata/0", "") == old[0]  # mark as recently used
    make_room(copies.folder.parent, 35)
    assert [path.exists() for path in old] == [True, False, False, False, True, True]


def test_open_files_are_not_evicted(copies):
    path = add(copies, "metadata/now", size=100)
    make_room(copies.folder.parent, 0)
    assert path.exists()


def test_free_space_is_checked_periodically(copies, monkeypatch):
    monkeypatch.setenv("SCENARIONET_CACHE_GB", "0.00000005")  # 50 bytes
    monkeypatch.setattr(cache, "_CHECK_EVERY", 40)
    old = [add(copies, f"metadata/{k}", size=20, hours=10 - k) for k in range(9)]
    assert sum(path.exists() for path in old) <= 4


def test_object_store_in_forked_process_raises_error(monkeypatch):
    monkeypatch.setattr(store_client, "_first_used_by", os.getpid() + 1)
    with pytest.raises(LakeError, match="start workers by spawn"):
        object_store.ObjectStore("s3://bucket/lake")
