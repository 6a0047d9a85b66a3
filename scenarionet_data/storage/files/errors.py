"""What the operating system refuses, as errors that name the file and the remedy."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pyarrow as pa

from scenarionet_data.errors import FileGone, LakeError


@contextmanager
def writing(path: Path, temporary: Path | None = None) -> Iterator[None]:
    """Turns the operating system's refusals into a LakeError with the remedy.

    Args:
        path: What the message names.
        temporary: Removed when anything goes wrong, so that a full disk is not kept full.
    """
    try:
        yield
    except BaseException as error:
        if temporary is not None:
            with suppress(OSError):  # where nothing may be written there is nothing to remove
                temporary.unlink()
        if isinstance(error, OSError):
            raise LakeError(f"cannot write {path}: {_reason(error)}; {_remedy(error)}") from error
        raise


@contextmanager
def reading(path: Path | str) -> Iterator[None]:
    """Turns a file that is gone, unreadable or damaged into a LakeError with the remedy."""
    try:
        yield
    except FileGone:
        raise
    except (OSError, pa.ArrowInvalid) as error:
        raise LakeError(
            f"cannot read {path}: {_reason(error)}; `scenarionet check` names every scenario that is hit: restore the "
            "file from a copy of the lake, or `scenarionet fsck --repair` and convert its recordings again"
        ) from error


def _reason(error: Exception) -> str:
    """The system's own words, without Arrow's around them."""
    number = getattr(error, "errno", None)
    return os.strerror(number) if number else str(error)


def _remedy(error: OSError) -> str:
    if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
        return "free some space and run the same command again: finished shards are kept"
    if error.errno in (errno.EACCES, errno.EPERM, errno.EROFS):
        return "choose a folder you may write to, or change its permissions"
    if error.errno in (errno.ENOTDIR, errno.EEXIST):
        return "choose a folder, not a file"
    return "finished shards are kept: mend the cause and run the same command again"
