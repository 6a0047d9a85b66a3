"""Packs: a database with all data of its members, as a small, self-contained lake.

A pack has the members' rows of all tables, the tiles of shared maps in their windows, their rows of user columns, their
kept moments, and the database under the same ``name@version``. It is a lake with one snapshot, so it can be read like
any lake.
``README.md`` is its card for Hugging Face; ``SHA256SUMS`` lists every file in the format of ``sha256sum -c``.
"""

from __future__ import annotations

import shutil
import tarfile
import tempfile
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from scenarionet_data.databases import pack_origins
from scenarionet_data.databases.record import DatabaseRecord
from scenarionet_data.errors import BadParameter, LakeError
from scenarionet_data.execution.progress import Progress
from scenarionet_data.loader import ScenarioLoader
from scenarionet_data.packs.card import CARD, check_publishable
from scenarionet_data.packs.contents import SUMS, PackWriter
from scenarionet_data.query.lake_view import LakeLike, LakeView, open_view
from scenarionet_data.scenario.content_hash import content_hash
from scenarionet_data.storage import kept_moments
from scenarionet_data.storage.files.errors import writing
from scenarionet_data.storage.files.lake_files import IDENTITY
from scenarionet_data.storage.files.local import LocalLakeFiles
from scenarionet_data.storage.files.places import is_url, local_path
from scenarionet_data.storage.files.uploading import RemoteFolder

_UPLOADED_FIRST = (
    IDENTITY,
    "tracks/",
    "lights/",
    "maps/",
    "metadata/",
    "layers/",
    "databases/",
    f"{kept_moments.FOLDER}/",
    pack_origins.FILE,
    CARD,
    SUMS,
)
"""Without a snapshot, these files at a URL are left from an interrupted upload."""


@dataclass(frozen=True)
class PackReport:
    """Contents of a pack.

    Attributes:
        path: The folder, its URL, or the tar.
        reference: ``name@version`` of the database in it.
        num_scenarios: Number of members.
        num_files: Number of files, without SHA256SUMS.
        num_bytes: Total size of these files.
    """

    path: Path | str
    reference: str
    num_scenarios: int
    num_files: int
    num_bytes: int


def pack(
    lake: LakeLike,
    database: DatabaseRecord | str,
    path: str | Path,
    *,
    tar: bool = False,
    publishable: bool = False,
    on_progress: Progress | None = None,
) -> PackReport:
    """Write a database and all data of its members as a lake; see :meth:`Lake.pack <scenarionet_data.Lake.pack>`."""
    view = open_view(lake)
    if is_url(path) and not tar:
        return _pack_to_url(view, database, str(path).rstrip("/"), publishable, on_progress)
    out = local_path(path, "a tar")
    if out.exists() or out.is_symlink():
        raise BadParameter(f"{out}: exists; choose another name, or remove it first")
    record = view.record(database)
    if not record.is_saved:
        raise BadParameter("this selection is not saved: give it a name with selection.save(name), then pack it")
    if not len(record):
        raise BadParameter(f"{record.reference} has no members: nothing to pack")
    view, members = view.resolve(record)
    if publishable:
        check_publishable(record.reference, members)
    with _draft(out) as draft:
        written = PackWriter(view, record, LocalLakeFiles(draft), on_progress)
        written.write()
        hashes = record.members["content_hash"].to_pylist()
        for done, (scenario, expected) in enumerate(
            zip(ScenarioLoader(draft, record.reference), hashes, strict=True), start=len(record) + 1
        ):
            if content_hash(scenario) != expected:
                raise LakeError(
                    f"{scenario.id} is damaged in the lake: not as it was converted; restore its files from a copy of "
                    "the lake, or convert its recordings again"
                )
            if on_progress:
                on_progress(done, 2 * len(record), done // 2)
        num_bytes = sum(draft.joinpath(name).stat().st_size for name in written.sums)
        finished = _as_tar(draft, out) if tar else draft
        with writing(out):
            finished.rename(out)
    return PackReport(out, record.reference, len(record), len(written.sums), num_bytes)


def _pack_to_url(
    view: LakeView, database: DatabaseRecord | str, url: str, publishable: bool, on_progress: Progress | None
) -> PackReport:
    """Write the pack to a temporary folder and upload it; its snapshot last, by which a lake is recognised."""
    remote = RemoteFolder(url)
    if any(not name.startswith(_UPLOADED_FIRST) for name in remote.names()):
        raise BadParameter(f"{url}: exists; choose another name, or remove it first")
    with tempfile.TemporaryDirectory(prefix="scenarionet-") as folder:
        report = pack(view, database, Path(folder, "pack"), publishable=publishable, on_progress=on_progress)
        snapshots = LocalLakeFiles(report.path).names("snapshots")
        remote.upload(Path(report.path), last=[SUMS, *reversed(snapshots)])  # the manifest, then the snapshot
    return replace(report, path=url)


@contextmanager
def _draft(out: Path) -> Iterator[Path]:
    """Create a temporary folder next to ``out``; it is removed at the end unless it was renamed."""
    draft = out.with_name(f".{out.name}-{uuid.uuid4().hex[:8]}")
    try:
        with writing(out):
            draft.mkdir(parents=True)
        yield draft
    finally:
        shutil.rmtree(draft, ignore_errors=True)


def _as_tar(folder: Path, out: Path) -> Path:
    """Write the folder to a tar inside it, named as ``out`` without its suffix; equal content gives equal bytes."""
    names = sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())
    path = folder / ".tar"
    with writing(out), tarfile.open(path, "w", format=tarfile.PAX_FORMAT) as archive:
        for name in names:
            entry = tarfile.TarInfo(f"{out.name.removesuffix('.tar')}/{name}")
            entry.size = (folder / name).stat().st_size
            with (folder / name).open("rb") as file:
                archive.addfile(entry, file)
    return path
