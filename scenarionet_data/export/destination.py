"""The folder or URL that a database of pickles is written to: a draft first, put in place when it is complete."""

from __future__ import annotations

import secrets
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from scenarionet_data.errors import DatabaseExists, LakeError, ScenarioNetError
from scenarionet_data.storage.files.places import is_url
from scenarionet_data.storage.files.uploading import RemoteFolder

SUMMARY_FILE = "dataset_summary.pkl"
MAPPING_FILE = "dataset_mapping.pkl"
_INDEX = (MAPPING_FILE, SUMMARY_FILE)


def check_destination(directory: Path | str, replace: bool) -> None:
    """Raise if something else than an empty folder is there, or a database and ``replace`` is False.

    Raises:
        DatabaseExists: The message names what is there.
    """
    names = RemoteFolder(str(directory)).names() if is_url(directory) else _names_in(Path(directory))
    foreign = next((name for name in names if not _is_ours(name)), None)
    if foreign is not None:
        raise DatabaseExists(
            f"{directory}: contains {foreign!r} and is not a database of pickles; give another directory"
        )
    is_complete = SUMMARY_FILE in names or not is_url(directory)  # an upload may have been interrupted
    if names and is_complete and not replace:
        raise DatabaseExists(f"{directory}: is not empty; pass replace=True, or give another directory")


def _names_in(directory: Path) -> list[str]:
    if not directory.exists():
        return []
    if not directory.is_dir():
        raise DatabaseExists(f"{directory}: is a file; give another directory")
    return [path.name if path.is_file() else f"{path.name}/" for path in directory.iterdir()]


def _is_ours(name: str) -> bool:
    path = Path(name)
    is_scenario = path.suffix == ".pkl" and (path.stem.startswith("sd_") or path.stem.isdigit())
    return not name.endswith("/") and path.name == name and (is_scenario or name in _INDEX)


@contextmanager
def new_directory(directory: Path | str) -> Iterator[Path]:
    """Yield a temporary folder that replaces ``directory`` when the block ends, or is deleted if it fails.

    At a URL the files are uploaded, the index last.

    Raises:
        LakeError: The disk is full or not writable, also on workers; or the object store does not answer.
    """
    try:
        if is_url(directory):
            with tempfile.TemporaryDirectory(prefix="scenarionet-") as draft:
                yield Path(draft)
                RemoteFolder(str(directory)).upload(Path(draft), last=_INDEX)
        else:
            with _sibling(Path(directory)) as folder:
                yield folder
    except ScenarioNetError:
        raise
    except OSError as error:
        raise LakeError(
            f"cannot write {directory}: {error.strerror or error}; nothing was written: free some space or choose "
            "another directory, and run the same command again"
        ) from error


@contextmanager
def _sibling(directory: Path) -> Iterator[Path]:
    mark = secrets.token_hex(4)
    draft = directory.with_name(f".{directory.name}.{mark}.new")
    try:
        draft.mkdir(parents=True)
        yield draft
        old = directory.with_name(f".{directory.name}.{mark}.old")
        is_replaced = directory.exists()
        if is_replaced:
            directory.replace(old)
        try:
            draft.replace(directory)
        except OSError:
            if is_replaced:
                old.replace(directory)
            raise
        if is_replaced:
            shutil.rmtree(old)
    finally:
        shutil.rmtree(draft, ignore_errors=True)
