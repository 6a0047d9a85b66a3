"""Convert errors of the operating system into LakeErrors that name the file and the remedy."""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pyarrow as pa

from scenarionet_data.errors import FileGone, LakeError

_REMEDIES: dict[int | None, str] = {
    **dict.fromkeys(
        (errno.ENOSPC, errno.EDQUOT, errno.EFBIG),
        "free some space and run the same command again: finished shards are kept",
    ),
    **dict.fromkeys((errno.EACCES, errno.EPERM, errno.EROFS), "choose a writable folder, or change its permissions"),
    **dict.fromkeys((errno.ENOTDIR, errno.EEXIST), "choose a folder, not a file"),
}


@contextmanager
def writing(path: Path, temporary: Path | None = None) -> Iterator[None]:
    """Convert an OSError while writing into a LakeError with the remedy.

    Args:
        path: Path for the message.
        temporary: A file to remove on any error, so that it does not keep a full disk full.
    """
    try:
        yield
    except BaseException as error:
        if temporary is not None:
            with suppress(OSError):  # not writable, so there is no file to remove
                temporary.unlink()
        if isinstance(error, OSError) and not isinstance(error, FileGone):
            remedy = "fix the cause and run the same command again: finished shards are kept"
            raise LakeError(f"cannot write {path}: {_reason(error)}; {_REMEDIES.get(error.errno, remedy)}") from error
        raise


@contextmanager
def reading(path: Path | str) -> Iterator[None]:
    """Convert errors from a missing, unreadable or damaged file into a LakeError with the remedy."""
    try:
        yield
    except FileGone:
        raise
    except (OSError, pa.ArrowException, UnicodeDecodeError) as error:
        raise damaged(path, _reason(error)) from error


def damaged(url: Path | str, reason: str) -> LakeError:
    """The error for a file that is missing, unreadable, or not as it was written."""
    return LakeError(
        f"cannot read {url}: {reason}; `scenarionet maintain check` lists the affected scenarios: restore the file "
        "from a copy of the lake, or `scenarionet maintain fsck --repair` and convert its recordings again"
    )


def check_is_file(path: Path) -> None:
    """Raise unless a path is missing or a file: a pipe would be read for ever.

    Raises:
        LakeError: It is something else.
    """
    with reading(path), suppress(FileNotFoundError):
        if not stat.S_ISREG(path.stat().st_mode):
            raise damaged(path, "it is no file")


def _reason(error: Exception) -> str:
    """The message of the operating system, without what Arrow adds to it and without the internals of Parquet."""
    number = getattr(error, "errno", None)
    return os.strerror(number) if number else "its headers are damaged" if "thrift" in str(error) else str(error)
