"""Verify a snapshot's files: sizes, checksums, footers, and all referenced rows."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from scenarionet_data.arrays.dtypes import Int64, Object
from scenarionet_data.schema import tables
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.integrity.file_checks import Damage, Intact, Written, check_file, finding
from scenarionet_data.storage.read.metadata_rows import ADDRESS_COLUMNS
from scenarionet_data.storage.snapshots import manifests
from scenarionet_data.storage.snapshots.snapshot import Snapshot

_PARTITION = ["dataset", "version", "split"]


def verify(
    files: LakeFiles,
    snapshot: Snapshot,
    digest: Callable[[str], str] | None = None,
    on_progress: Callable[[int, int], None] | None = None,
) -> Iterator[Damage]:
    """Find all damage in the files of a snapshot; each file is read once.

    Args:
        files: The lake's files.
        snapshot: The snapshot.
        digest: Returns the SHA-256 of a file; computed by default.
        on_progress: Called with files read and files to read.
    """
    broken: list[Damage] = []
    for name in snapshot.manifests:
        with finding(name, broken):
            check_file(files, name, Written(), table="shards", is_deep=True)
            manifests.read(files, name)
    yield from broken
    if broken:
        return  # the contents of the snapshot are unknown
    verifier = Verifier(files, digest=digest)
    shards = manifests.shard_table(files, snapshot)
    yield from verifier.files(dict.fromkeys(snapshot.metadata, Written()))
    are_addresses_known = not verifier.broken
    yield from verifier.files(listed(shards), on_progress)
    if are_addresses_known:
        yield from verifier.references(snapshot, shards)


def listed(shards: pa.Table) -> dict[str, Written]:
    """Sizes and checksums of the files of some shards, by name; shards may share files."""
    columns = ["files", "sizes", "checksums"]
    flat = pa.table([pc.list_flatten(shards[name]) for name in columns], columns)
    distinct = flat.group_by(columns, use_threads=False).aggregate([])  # merged manifests repeat most of the others
    return {
        name: Written(size, checksum)
        for name, size, checksum in zip(*(distinct[name].to_pylist() for name in columns), strict=True)
    }


class Verifier:
    """Checks files of a lake, then the references to them.

    Args:
        files: The lake's files.
        is_deep: Whether to read every byte and the scenario of every row.
        workers: Threads that read files.
        digest: Returns the SHA-256 of a file; computed by default.

    Attributes:
        broken: Names of the damaged files.
        intact: The other checked files, by name.
    """

    def __init__(
        self,
        files: LakeFiles,
        *,
        is_deep: bool = True,
        workers: int = 1,
        digest: Callable[[str], str] | None = None,
    ) -> None:
        self.broken: set[str] = set()
        self.intact: dict[str, Intact] = {}
        self._files = files
        self._is_deep = is_deep
        self._workers = workers
        self._digest = digest

    def files(
        self, written: Mapping[str, Written], on_progress: Callable[[int, int], None] | None = None
    ) -> Iterator[Damage]:
        """Find damage in files of tables.

        Args:
            written: Size and checksum of each file by name.
            on_progress: Called with files read and files to read.
        """
        with ThreadPoolExecutor(self._workers) as pool:
            results = map(self._file, written.items()) if self._workers == 1 else pool.map(self._file, written.items())
            for done, (name, result) in enumerate(results, start=1):
                if isinstance(result, Damage):
                    self.broken.add(name)
                    yield result
                else:
                    self.intact[name] = result
                if on_progress:
                    on_progress(done, len(written))

    def _file(self, item: tuple[str, Written]) -> tuple[str, Intact | Damage]:
        """Check one file."""
        name, written = item
        damages: list[Damage] = []
        intact: Intact | None = None
        with finding(name, damages):
            table = name.split("/")[0]
            intact = check_file(self._files, name, written, table=table, is_deep=self._is_deep, digest=self._digest)
        return name, intact or damages[0]

    def references(self, snapshot: Snapshot, shards: pa.Table) -> Iterator[Damage]:
        """Find wrong references of a snapshot, after its files have been checked.

        Args:
            snapshot: The snapshot.
            shards: Its shards.
        """
        table = tables.load("metadata")
        names = ["scenario_id", *_PARTITION, "map_id", "map_crop", *ADDRESS_COLUMNS]
        parts = [table.conform(part, names) for part in self._files.read_all(snapshot.metadata, names)]
        rows = pa.concat_tables([table.schema.empty_table().select(names), *parts])
        # No scenario has the address of rows of a shared map.
        shared = set(listed(shards.filter(pc.equal(shards["split"], ""))))
        yield from self._wrong_addresses(rows, set(listed(shards)), shared)
        yield from _missing_maps(rows, shards)
        yield from _wrong_counts(rows, shards)

    def _wrong_addresses(self, rows: pa.Table, known: set[str], shared: set[str]) -> Iterator[Damage]:
        """Find scenarios with wrong addresses (one per file), and files without scenarios."""
        for table in tables.LOADED:
            addressed = rows.filter(pc.greater(rows[f"{table}_num_rows"], 0))
            names = addressed[f"{table}_file"].cast(pa.string()).combine_chunks().dictionary_encode()
            ids = addressed["scenario_id"].to_numpy(zero_copy_only=False)
            parts = (addressed[f"{table}_{part}"].fill_null(-1) for part in ("row_group", "first_row", "num_rows"))
            places = np.column_stack([part.to_numpy() for part in parts]).reshape(-1, 3)
            codes = names.indices.fill_null(-1).to_numpy()
            for row in np.flatnonzero(codes < 0)[:1]:
                yield Damage(f"{table}/", f"{ids[row]} has rows, but no file that holds them")
            for code, name in enumerate(names.dictionary.to_pylist()):
                chosen = np.flatnonzero(codes == code)
                if name not in known:
                    yield Damage(name, f"holds {ids[chosen[0]]}, but no shard of the snapshot lists it")
                if name in self.intact:  # otherwise its damage is reported already
                    yield from self._wrong_file(name, ids[chosen], places[chosen])
            left = sorted((known - shared - set(names.dictionary.to_pylist())) & set(self.intact))
            yield from (Damage(name, "no scenario has its rows here") for name in left if name.startswith(f"{table}/"))

    def _wrong_file(self, name: str, ids: Object, places: Int64) -> Iterator[Damage]:
        """Find a scenario whose rows are not at its address in a file.

        Args:
            name: The file.
            ids: (n,) scenario ids.
            places: (n, 3) row group, first row, number of rows of each.
        """
        number, first, count = places.T
        held = self.intact[name].groups
        there = np.append(held, 0)  # the last element is for row groups that do not exist
        wrong = (first < 0) | (first + count > there[np.where((number >= 0) & (number < len(held)), number, -1)])
        for row in np.flatnonzero(wrong)[:1]:
            yield Damage(name, f"row group {number[row]} does not hold the {count[row]} rows of {ids[row]}")
        if wrong.any():
            return
        if count.sum() != held.sum():
            yield Damage(name, f"{held.sum():,} rows, but its scenarios have {count.sum():,} of them")
        elif self._is_deep:
            start = np.append(0, np.cumsum(held))[number] + first
            yield from self._strangers(name, ids, start, count)

    def _strangers(self, name: str, ids: Object, start: Int64, count: Int64) -> Iterator[Damage]:
        """Find a row that belongs to a scenario other than its address states."""
        key = "map_id" if name.startswith("maps/") else "scenario_id"
        found = self._files.read(name, [key])[key].to_numpy()
        offsets = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        differs = found[np.repeat(start, count) + offsets] != np.repeat(ids, count)
        for row in np.flatnonzero(differs)[:1]:
            wanted = np.repeat(ids, count)[row]
            yield Damage(name, f"rows of another scenario where {wanted} should be")


# --- references -------------------------------------------------------------------------------------------


def _missing_maps(rows: pa.Table, shards: pa.Table) -> Iterator[Damage]:
    """Find shared maps that scenarios refer to and no shard contains."""
    keys = ["dataset", "version", "map_id"]
    shared = shards.filter(pc.equal(shards["split"], ""))
    there = set(zip(*(shared[name].to_pylist() for name in ("dataset", "version", "name")), strict=True))
    seen = rows.filter(pc.is_valid(rows["map_crop"]))
    wanted = set(zip(*(seen[name].to_pylist() for name in keys), strict=True))
    for dataset, version, map_id in sorted(wanted - there):
        yield Damage(f"maps/dataset={dataset}/version={version}/", f"no map {map_id!r}, which scenarios are windows on")


def _wrong_counts(rows: pa.Table, shards: pa.Table) -> Iterator[Damage]:
    """Find partitions whose number of scenarios differs from that of their shards."""
    texts = pa.table({name: rows[name].cast(pa.string()) for name in _PARTITION})
    held = texts.group_by(_PARTITION).aggregate([([], "count_all")])
    said = shards.group_by(_PARTITION).aggregate([("num_scenarios", "sum")])
    found = {tuple(row[name] for name in _PARTITION): row["count_all"] for row in held.to_pylist()}
    for row in said.to_pylist():
        key = tuple(row[name] for name in _PARTITION)
        if found.get(key, 0) != row["num_scenarios_sum"]:
            folder = "metadata/" + "/".join(f"{n}={value}" for n, value in zip(_PARTITION, key, strict=True))
            yield Damage(folder, f"{found.get(key, 0):,} scenarios, its shards have {row['num_scenarios_sum']:,}")
