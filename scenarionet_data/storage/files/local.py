"""Files of a lake in a folder."""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from scenarionet_data.errors import LakeError
from scenarionet_data.storage.files.errors import reading, writing
from scenarionet_data.storage.files.lake_files import LakeFiles, Listed, delete, flush, make_folder, sha256


class LocalLakeFiles(LakeFiles):
    """Files below a folder.

    Args:
        root: The lake's folder; it need not exist yet.
    """

    def __init__(self, root: str | Path) -> None:
        self.root = self._folder = Path(os.path.realpath(root))
        self.scanned_folders = [f"{self._folder}/"]

    # --- listing ----------------------------------------------------------------------------------------

    def names(self, folder: str, suffix: str = "") -> list[str]:
        """Files directly in ``folder``, sorted; empty when the folder does not exist."""
        found = []
        for entry in self._entries(folder):
            if entry.name.endswith(suffix) and Path(entry).is_file():
                found.append(f"{folder}/{entry.name}")
        return sorted(found)

    def folders(self, folder: str) -> list[str]:
        """Names of the folders directly in ``folder``, sorted."""
        found = []
        for entry in self._entries(folder):
            if Path(entry).is_dir():
                found.append(entry.name)
        return sorted(found)

    def listing(self, folder: str) -> list[Listed]:
        """Every file below a folder, at any depth, in any order."""
        found = []
        for entry in self._entries(folder):
            name = f"{folder}/{entry.name}"
            if entry.is_dir(follow_symlinks=False):
                found += self.listing(name)
                continue
            with suppress(OSError):  # removed since it was listed, or a link to nothing
                state = entry.stat()
                found.append(Listed(name, state.st_size, state.st_mtime))
        return found

    def strange(self) -> dict[str, str]:
        """What is neither a file nor a folder, by name, with what it is."""
        found = {}
        for folder, names, files in os.walk(self._folder):
            links = [path for path in map(Path(folder).joinpath, names) if path.is_symlink()]
            for path in (*links, *map(Path(folder).joinpath, files)):
                name = path.relative_to(self._folder).as_posix()
                try:
                    mode, target = path.stat().st_mode, path.resolve()
                except FileNotFoundError:
                    found[name] = "a link to nothing"
                except (OSError, RuntimeError):
                    found[name] = "a link in a circle"
                else:
                    if stat.S_ISDIR(mode) and path.parent.resolve().is_relative_to(target):
                        found[name] = "a link in a circle"
                    elif not stat.S_ISREG(mode) and not stat.S_ISDIR(mode):
                        found[name] = "a pipe, a socket or a device"
        return found

    def _entries(self, folder: str) -> list[os.DirEntry[str]]:
        path = self._folder / folder
        with reading(path):
            try:
                return list(os.scandir(path))
            except (FileNotFoundError, NotADirectoryError):
                return []

    def size(self, name: str) -> int | None:
        """Bytes of a file; None when it does not exist."""
        try:
            return self.path(name).stat().st_size
        except OSError:
            return None

    # --- reading ----------------------------------------------------------------------------------------

    def digest(self, name: str) -> str:
        """SHA-256 of a file, hexadecimal."""
        path = self.path(name)
        with reading(path):
            return sha256(path)

    # --- writing ----------------------------------------------------------------------------------------

    def publish(self, temporary: Path, name: str) -> None:
        """Rename a complete temporary file, after its bytes have reached the disk."""
        target = self.path(name)
        with writing(target, temporary):
            make_folder(target.parent)
            flush(temporary)
            temporary.replace(target)
            flush(target.parent)

    def publish_new(self, name: str, data: bytes | Path) -> bool:
        """Publish bytes or a temporary file unless a file of that name exists; see :class:`LakeFiles`."""
        temporary = data if isinstance(data, Path) else self.temporary()
        target = self.path(name)
        with writing(target, temporary):
            if isinstance(data, bytes):
                temporary.write_bytes(data)
            flush(temporary)
            make_folder(target.parent)
            try:
                os.link(temporary, target)
            except FileExistsError:
                if isinstance(data, bytes):
                    temporary.unlink()
                return False
            flush(target.parent)
            temporary.unlink()
        return True

    def publish_folder(self, temporary: Path, name: str) -> bool:
        """Rename a temporary folder unless a folder of that name has files; see :class:`LakeFiles`."""
        target = self.path(name)
        with writing(target):
            for path in (*temporary.iterdir(), temporary):
                flush(path)
            try:
                temporary.rename(target)
            except OSError as error:
                delete(temporary)
                if error.errno not in (errno.ENOTEMPTY, errno.EEXIST):
                    raise
                return False
            flush(target.parent)
        return True

    def remove(self, name: str) -> None:
        """Remove a file or folder; a folder disappears as a whole."""
        path = self.path(name)
        with writing(path):
            if not path.is_dir():
                path.unlink()
                return
            removed = self.temporary()
            path.rename(removed)
            with suppress(FileNotFoundError):  # swept by another job, because it is old
                delete(removed)

    def remove_unchanged(self, listed: Listed) -> bool:
        """Remove a file unless it has been published or renewed since it was listed; returns whether it did."""
        path, removed = self.path(listed.name), self.temporary()
        with writing(path):
            try:
                path.rename(removed)  # before the time is compared: from here on no job can renew it
            except FileNotFoundError:
                return False
            with suppress(FileNotFoundError):  # swept by another job, because it is old
                if removed.stat().st_mtime != listed.modified:
                    removed.rename(path)
                    return False
                removed.unlink()
        return True

    def renew(self, names: Iterable[str]) -> list[str]:
        """Touch published files; returns those that no longer exist."""
        missing = []
        for name in names:
            path = self.path(name)
            try:
                with writing(path):
                    os.utime(path)
            except LakeError as error:
                if not isinstance(error.__cause__, FileNotFoundError):
                    raise
                missing.append(name)
        return missing
