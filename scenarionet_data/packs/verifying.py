"""Verification of packs: every checksum, footer, row, member and reference."""

from __future__ import annotations

import tarfile
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path, PurePosixPath

import pyarrow as pa

from scenarionet_data.databases import record as records
from scenarionet_data.errors import BadParameter
from scenarionet_data.execution.progress import Progress
from scenarionet_data.packs.contents import SUMS
from scenarionet_data.schema import tables
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.files.local import LocalLakeFiles
from scenarionet_data.storage.files.places import is_url, open_files, path_of
from scenarionet_data.storage.integrity.file_checks import Damage
from scenarionet_data.storage.integrity.snapshot_checks import verify
from scenarionet_data.storage.snapshots import snapshot as snapshots

_LISTS = ("snapshots", "metadata", "databases")


@dataclass(frozen=True)
class PackVerification:
    """Result of the verification of a pack.

    Attributes:
        path: The pack, or its URL.
        num_files: Number of files that SHA256SUMS lists.
        references: ``name@version`` of its databases.
        damages: Damages, one per file.
    """

    path: Path | str
    num_files: int
    references: tuple[str, ...]
    damages: tuple[Damage, ...]

    @property
    def is_whole(self) -> bool:
        """Whether there are no damages."""
        return not self.damages


def verify_pack(path: str | Path, on_progress: Progress | None = None) -> PackVerification:
    """Verify a pack: a folder, its URL, or a tar, which is unpacked to a temporary folder.

    Args:
        path: The pack.
        on_progress: Called after each file.

    Raises:
        BadParameter: ``path`` does not exist, or is not a pack.
    """
    if is_url(path):
        return _verify_folder(open_files(path), path, on_progress)
    path = path_of(path, "give the folder or tar of a pack")
    if path.is_dir():
        return _verify_folder(LocalLakeFiles(path), path, on_progress)
    if not path.is_file():
        raise BadParameter(f"{path}: no such pack; make one with `scenarionet pack LAKE DB {path}`")
    with tempfile.TemporaryDirectory(prefix="scenarionet-") as folder:
        try:
            with tarfile.open(path) as archive:
                archive.extractall(folder, filter="data")
        except (tarfile.TarError, EOFError) as error:
            return PackVerification(path, 0, (), (Damage(path.name, f"cannot be unpacked: {error}"),))
        inner = sorted(Path(folder).iterdir())
        if len(inner) != 1:
            raise BadParameter(f"{path}: not a pack; expected a tar with one folder, found {len(inner)}")
        return _verify_folder(LocalLakeFiles(inner[0]), path, on_progress)


def _verify_folder(files: LakeFiles, path: Path | str, on_progress: Progress | None) -> PackVerification:
    if not files.has(SUMS):
        if not files.folders("snapshots") and not files.names("snapshots"):
            raise BadParameter(f"{path}: no pack; wanted a folder with {SUMS}, or a tar of it")
        return PackVerification(path, 0, (), (Damage(SUMS, "gone"),))
    text = files.path(SUMS).read_bytes().decode("utf-8", errors="replace")
    pairs = [line.split("  ", 1) for line in text.splitlines() if "  " in line]
    # Without invalid lines, and paths that lead out of the pack.
    sums = {name: digest for digest, name in pairs if ".." not in PurePosixPath(name).parts and name[:1] != "/"}
    references = tuple(_references(sums))
    damages: dict[str, Damage] = {}
    for damage in _damages(files, sums, on_progress):
        damages.setdefault(damage.file, damage)
    return PackVerification(path, len(sums), references, tuple(damages.values()))


def _damages(files: LakeFiles, sums: dict[str, str], on_progress: Progress | None) -> Iterator[Damage]:
    digest = cache(files.digest)
    are_lists_whole = bool(sums)
    if not sums:
        yield Damage(SUMS, "lists no files, or is damaged")
    for done, (name, wanted) in enumerate(sums.items(), start=1):
        found = digest(name) if files.has(name) else None
        if found != wanted:
            yield Damage(name, "its bytes are not those that were packed: another checksum" if found else "gone")
            are_lists_whole &= name.split("/")[0] not in _LISTS
        if on_progress:
            on_progress(done, len(sums), 0)
    if are_lists_whole:  # otherwise references between files cannot be checked
        snapshot = snapshots.read(files)
        unlisted = sorted({*snapshot.manifests, *snapshot.metadata} - set(sums))
        if unlisted or not _references(sums):
            yield Damage(SUMS, f"does not list {unlisted[0] if unlisted else 'the database'}")
        yield from verify(files, snapshot, digest)
        yield from _lost_members(files, _references(sums))


def _references(sums: dict[str, str]) -> list[str]:
    """Return ``name@version`` of the packed databases."""
    paths = [PurePosixPath(name) for name in sums if name.startswith("databases/")]
    return [f"{path.parent.name}@{path.stem}" for path in paths]


def _lost_members(files: LakeFiles, references: list[str]) -> Iterator[Damage]:
    """Yield a damage for each database with members that the snapshot lacks or has with other content."""
    snapshot = snapshots.read(files)
    columns = ["scenario_id", "content_hash"]
    empty = tables.load("metadata").schema.empty_table().select(columns)
    there = pa.concat_tables([empty, *(files.read(name, columns) for name in snapshot.metadata if files.has(name))])
    for reference in references:
        name, version = records.parse_reference(reference)
        found = records.read(files, name, version)
        lost = found.members.select(columns).join(there, columns, join_type="left anti")
        if lost.num_rows or not len(found):
            example = f", for example {lost['scenario_id'][0]}" if lost.num_rows else ""
            reason = f"{lost.num_rows:,} of {len(found):,} members are not in the pack{example}"
            yield Damage(f"databases/{name}/{version}.parquet", reason)
