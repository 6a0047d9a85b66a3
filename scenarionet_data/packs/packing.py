"""Packs: a database with everything that belongs to its members, as a small lake of its own.

A pack holds the members' row groups as they are in the lake (their pages are not touched), the tiles of shared maps
that the members see, their rows of metadata and of users' columns, and the database under the same ``name@version``.
It is a lake with one snapshot: whatever reads a lake reads a pack, wherever it lies. ``SHA256SUMS`` lists every file
in the format of ``sha256sum -c``.
"""

from __future__ import annotations

import shutil
import tarfile
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from scenarionet_data.databases.record import Database
from scenarionet_data.errors import BadParameter, LakeError
from scenarionet_data.execution.progress import Progress
from scenarionet_data.storage.files.errors import writing
from scenarionet_data.storage.files.local import LocalLakeFiles

if TYPE_CHECKING:
    from scenarionet_data.lake.lake import Lake


@dataclass(frozen=True)
class Packed:
    """What a pack holds.

    Attributes:
        path: The folder or tar.
        reference: ``name@version`` of the database in it.
        num_scenarios: Members.
        num_files: Files, but for SHA256SUMS.
        num_bytes: Their sizes together.
    """

    path: Path
    reference: str
    num_scenarios: int
    num_files: int
    num_bytes: int


def pack(
    lake: Lake, database: Database | str, out: str | Path, *, tar: bool = False, on_progress: Progress | None = None
) -> Packed:
    """Write a database and all that belongs to it as a lake of its own.

    Args:
        lake: The lake.
        database: Or its name.
        out: Folder (or tar) to write, which must not exist; it appears whole or not at all.
        tar: Write a tar, with the folder in it.
        on_progress: Told after every 64 scenarios copied, and after each that was read back.

    Raises:
        BadParameter: There is something at ``out``, or the database has no members.
        ScenarioNotFound: A member is not in the lake.
        LakeError: A file that is needed is gone or damaged, or ``out`` cannot be written. Every scenario is read
            back from the pack and has to be what was converted, so that no damage is packed under good checksums.
    """
    from scenarionet_data.packs.contents import Contents

    out = Path(out)
    if out.exists() or out.is_symlink():
        raise BadParameter(f"{out}: exists; give another name, or remove it first")
    wanted = lake.database(database)
    if not len(wanted):
        raise BadParameter(f"{wanted.reference} has no members: there is nothing to pack")
    with _draft(out) as draft:
        contents = Contents(lake.resolve(wanted)[0], wanted, LocalLakeFiles(draft), on_progress)
        contents.write()
        _read_back(draft, wanted, on_progress)
        num_bytes = sum(draft.joinpath(name).stat().st_size for name in contents.sums)
        finished = _as_tar(draft, out) if tar else draft
        with writing(out):
            finished.rename(out)
    return Packed(out, wanted.reference, len(wanted), len(contents.sums), num_bytes)


def _read_back(draft: Path, wanted: Database, on_progress: Progress | None) -> None:
    """Compare the content of every scenario of a pack with what it was when it was converted."""
    from scenarionet_data.codec.content_hash import content_hash
    from scenarionet_data.lake.lake import Lake  # here: both import this module
    from scenarionet_data.loader import ScenarioLoader

    hashes = wanted.members["content_hash"].to_pylist()
    for done, (scenario, wanted_hash) in enumerate(zip(ScenarioLoader(Lake(draft), wanted), hashes, strict=True), 1):
        if content_hash(scenario) != wanted_hash:
            raise LakeError(
                f"{scenario.id} is damaged in the lake: not what was converted; restore its files from a copy of the "
                "lake, or convert its recordings again"
            )
        if on_progress:
            on_progress(len(wanted) + done, 2 * len(wanted), (len(wanted) + done) // 2)


@contextmanager
def _draft(out: Path) -> Iterator[Path]:
    """A folder beside ``out`` that vanishes at the end, with what was not given another name."""
    draft = out.with_name(f".{out.name}-{uuid.uuid4().hex[:8]}")
    try:
        with writing(out):
            draft.mkdir(parents=True)
        yield draft
    finally:
        shutil.rmtree(draft, ignore_errors=True)


def _as_tar(folder: Path, out: Path) -> Path:
    """The folder as a tar inside it, under the name of ``out`` without its suffix; equal content makes equal bytes."""
    names = sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())
    path = folder / ".tar"
    with writing(out), tarfile.open(path, "w", format=tarfile.PAX_FORMAT) as archive:
        for name in names:
            entry = tarfile.TarInfo(f"{out.name.removesuffix('.tar')}/{name}")
            entry.size = (folder / name).stat().st_size
            with (folder / name).open("rb") as file:
                archive.addfile(entry, file)
    return path
