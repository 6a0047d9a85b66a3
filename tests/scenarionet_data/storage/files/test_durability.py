"""A file that is published survives a power failure: its bytes, its name, and the folders above it are flushed."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from scenarionet_data.storage.files.local import LocalLakeFiles


@pytest.fixture
def flushed(monkeypatch) -> list[tuple[str, set[str]]]:
    """Path of every flushed file or folder, and the names in a folder at that moment."""
    seen = []
    original = os.fsync

    def fsync(descriptor):
        path = Path(f"/proc/self/fd/{descriptor}").readlink()
        seen.append((str(path), {each.name for each in path.iterdir()} if path.is_dir() else set()))
        original(descriptor)

    monkeypatch.setattr(os, "fsync", fsync)
    return seen


def check_durable(root: Path, name: str, flushed: list[tuple[str, set[str]]]) -> None:
    """Each folder on the path was flushed after the next name was entered in it."""
    path = root / name
    while path != root.parent:
        assert any(folder == str(path.parent) and path.name in names for folder, names in flushed), path
        path = path.parent


@pytest.mark.parametrize("is_new", [False, True])
def test_published_files_are_flushed_with_all_folders(tmp_path, flushed, is_new):
    root = tmp_path / "lake"
    files = LocalLakeFiles(root)
    temporary = files.temporary()
    temporary.write_bytes(b"x")
    if is_new:
        assert files.publish_new("a/b/file", temporary)
    else:
        files.publish(temporary, "a/b/file")
    assert str(temporary) in [path for path, _ in flushed]
    check_durable(root, "a/b/file", flushed)


def test_published_folder_is_flushed_with_its_files(tmp_path, flushed):
    files = LocalLakeFiles(tmp_path)
    (tmp_path / "databases").mkdir()
    temporary = files.temporary()
    temporary.mkdir()
    (temporary / "1").write_bytes(b"x")
    assert files.publish_folder(temporary, "databases/a")
    assert {str(temporary / "1"), str(temporary)} <= {path for path, _ in flushed}
    assert flushed[-1] == (str(tmp_path / "databases"), {"a"})
