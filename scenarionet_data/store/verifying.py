"""Whether a snapshot's files are what was written: sizes, checksums, footers, and every row that is referred to."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from scenarionet_data import tables
from scenarionet_data.errors import LakeError
from scenarionet_data.store import snapshot as snapshots
from scenarionet_data.store.files import LakeFiles, reading, sha256
from scenarionet_data.store.snapshot import Snapshot

_ADDRESSED = ("tracks", "lights", "maps")
_PARTITION = ["dataset", "version", "split"]

Groups = Mapping[str, npt.NDArray[np.int64]]
"""Rows of each row group of a file, by its name."""


@dataclass(frozen=True)
class Damage:
    """What is wrong with a file.

    Attributes:
        file: Its name, relative to the lake.
        reason: What was wanted and what was found.
    """

    file: str
    reason: str


def verify(
    files: LakeFiles,
    snapshot: Snapshot,
    digest: Callable[[str], str] | None = None,
    on_progress: Callable[[int, int], None] | None = None,
) -> Iterator[Damage]:
    """Everything that is wrong with the files of a snapshot; each file of the lake is read once.

    Args:
        files: The lake.
        snapshot: Which version of it.
        digest: SHA-256 of a file by its name; computed unless given.
        on_progress: Called with files read and files to read.
    """
    lists = [*snapshot.manifests, *snapshot.metadata]
    broken = [damage for name in lists for damage in _unreadable(files, name)]
    yield from broken
    if {damage.file for damage in broken} & set(snapshot.manifests):
        return  # nobody can say what belongs to the snapshot
    shards = snapshots.shard_table(files, snapshot)
    groups: dict[str, npt.NDArray[np.int64]] = {}
    listed = list(zip(*(pc.list_flatten(shards[n]).to_pylist() for n in ("files", "sizes", "checksums")), strict=True))
    for done, (name, size, checksum) in enumerate(listed, start=1):
        damage = _changed(files, name, size, checksum, digest or (lambda name: sha256(files.path(name))))
        if damage is None:
            try:
                groups[name] = _row_groups(files, name)
            except LakeError as error:
                damage = Damage(name, str(error))
        if damage:
            yield damage
        if on_progress:
            on_progress(done, len(listed))
    if not broken:
        names = {name for name, _, _ in listed}
        rows = pa.concat_tables([files.read(name, _columns()) for name in snapshot.metadata] or [_no_rows()])
        yield from _wrong_addresses(rows, groups, names)
        yield from _missing_maps(rows, shards)
        yield from _wrong_counts(rows, shards)


def _unreadable(files: LakeFiles, name: str) -> Iterator[Damage]:
    try:
        files.read(name)
    except LakeError as error:
        yield Damage(name, str(error))


def _changed(files: LakeFiles, name: str, size: int, checksum: str, digest: Callable[[str], str]) -> Damage | None:
    """What is wrong with the bytes of a file."""
    found = files.size(name)
    if found is None:
        return Damage(name, "gone")
    if found != size:
        return Damage(name, f"{found:,} bytes long, was written with {size:,}")
    if digest(name) != checksum:
        return Damage(name, "its bytes are not those that were written: another checksum")
    return None


def _row_groups(files: LakeFiles, name: str) -> npt.NDArray[np.int64]:
    """Rows of each row group.

    Raises:
        LakeError: The footer cannot be read, or is of another version of the contract.
    """
    path = files.path(name)
    with reading(path):
        footer = pq.read_metadata(path)
    tables.load(name.split("/")[0]).check_version(footer.metadata, str(path))
    return np.array([footer.row_group(number).num_rows for number in range(footer.num_row_groups)], np.int64)


# --- references -------------------------------------------------------------------------------------------


def _columns() -> list[str]:
    parts = ("file", "row_group", "first_row", "num_rows")
    return ["scenario_id", *_PARTITION, "map_id", "map_crop", *(f"{t}_{part}" for t in _ADDRESSED for part in parts)]


def _no_rows() -> pa.Table:
    return tables.load("metadata").schema.empty_table().select(_columns())


def _wrong_addresses(rows: pa.Table, groups: Groups, listed: Iterable[str]) -> Iterator[Damage]:
    """Scenarios whose rows are not where their metadata say, one of each file."""
    known = set(listed)
    for table in _ADDRESSED:
        addressed = rows.filter(pc.greater(rows[f"{table}_num_rows"], 0))
        names = addressed[f"{table}_file"].cast(pa.string()).combine_chunks().dictionary_encode()
        ids = addressed["scenario_id"]
        number, first, count = (
            addressed[f"{table}_{part}"].fill_null(-1).to_numpy() for part in ("row_group", "first_row", "num_rows")
        )
        codes = names.indices.fill_null(-1).to_numpy()
        for row in np.flatnonzero(codes < 0)[:1]:
            yield Damage(f"{table}/", f"{ids[int(row)]} has rows, but no file that holds them")
        for code, name in enumerate(names.dictionary.to_pylist()):
            chosen = np.flatnonzero(codes == code)
            if name not in known:
                yield Damage(name, f"holds {ids[int(chosen[0])]}, but no shard of the snapshot lists it")
            if name not in groups:
                continue  # told already
            there = np.append(groups[name], 0)  # the last for numbers that there are none of
            held = there[np.where((number >= 0) & (number < len(there) - 1), number, -1)[chosen]]
            wrong = chosen[(first[chosen] < 0) | (first[chosen] + count[chosen] > held)]
            for row in wrong[:1]:
                yield Damage(name, f"row group {number[row]} does not hold the {count[row]} rows of {ids[int(row)]}")


def _missing_maps(rows: pa.Table, shards: pa.Table) -> Iterator[Damage]:
    """Shared maps that scenarios are windows on and no shard has."""
    keys = ["dataset", "version", "map_id"]
    shared = shards.filter(pc.equal(shards["split"], ""))
    there = set(zip(*(shared[name].to_pylist() for name in ("dataset", "version", "name")), strict=True))
    seen = rows.filter(pc.is_valid(rows["map_crop"]))
    wanted = set(zip(*(seen[name].to_pylist() for name in keys), strict=True))
    for dataset, version, map_id in sorted(wanted - there):
        yield Damage(f"maps/dataset={dataset}/version={version}/", f"no map {map_id!r}, which scenarios are windows on")


def _wrong_counts(rows: pa.Table, shards: pa.Table) -> Iterator[Damage]:
    """Partitions with other scenarios than their shards say."""
    texts = pa.table({name: rows[name].cast(pa.string()) for name in _PARTITION})
    held = texts.group_by(_PARTITION).aggregate([([], "count_all")])
    said = shards.group_by(_PARTITION).aggregate([("num_scenarios", "sum")])
    found = {tuple(row[name] for name in _PARTITION): row["count_all"] for row in held.to_pylist()}
    for row in said.to_pylist():
        key = tuple(row[name] for name in _PARTITION)
        if found.get(key, 0) != row["num_scenarios_sum"]:
            folder = "metadata/" + "/".join(f"{n}={value}" for n, value in zip(_PARTITION, key, strict=True))
            yield Damage(folder, f"{found.get(key, 0):,} scenarios, its shards have {row['num_scenarios_sum']:,}")
