"""Contents of a pack: rows of its members, shared maps, metadata, user columns, moments, and the database."""

from __future__ import annotations

import hashlib
import json
import shutil
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pyarrow as pa

from scenarionet_data.databases import pack_origins, user_columns
from scenarionet_data.databases.record import DatabaseRecord
from scenarionet_data.execution.progress import Progress
from scenarionet_data.operations.lineage import lineage_tree
from scenarionet_data.packs import tiles
from scenarionet_data.packs.card import CARD, make_card
from scenarionet_data.query.lake_view import LakeView
from scenarionet_data.schema import tables
from scenarionet_data.storage import kept_moments
from scenarionet_data.storage.files.errors import writing
from scenarionet_data.storage.files.lake_files import IDENTITY, LakeFiles, sha256
from scenarionet_data.storage.integrity.seals import Sealed
from scenarionet_data.storage.snapshots import manifests
from scenarionet_data.storage.snapshots import snapshot as snapshots
from scenarionet_data.storage.snapshots.shard_record import ShardRecord, partition, with_files
from scenarionet_data.storage.snapshots.snapshot import Snapshot
from scenarionet_data.storage.write.relocation import MAP_FOOTER, FileWriter, copy_groups, copy_sealed, provenance
from scenarionet_data.storage.write.shard_writer import SCENARIOS_PER_FILE
from scenarionet_data.storage.write.table_file import publish_data, publish_table

SUMS = "SHA256SUMS"
_SHARD = ("dataset", "version", "split", "converter_version", "options")
_ROWS_PER_GROUP = 65_536


def renew_sums(pack: LakeFiles) -> None:
    """Write SHA256SUMS again, after files of a pack have been replaced or added."""
    names = sorted(listed.name.removeprefix("./") for listed in pack.listing("."))
    _write_sums(pack, {name: pack.digest(name) for name in names if name != SUMS and not name.startswith(".tmp/")})


def _write_sums(pack: LakeFiles, sums: Mapping[str, str]) -> None:
    temporary = pack.temporary()
    with writing(temporary, temporary):
        temporary.write_text("".join(f"{digest}  {name}\n" for name, digest in sorted(sums.items())), "utf-8")
    pack.publish(temporary, SUMS)


class PackWriter:
    """Writes the contents of a pack.

    Args:
        view: The lake at a snapshot that has the members.
        database: The database to pack.
        target: Files of the pack.
        on_progress: Called after every 64 scenarios.

    Attributes:
        sums: SHA-256 of each file written.
    """

    def __init__(
        self, view: LakeView, database: DatabaseRecord, target: LakeFiles, on_progress: Progress | None = None
    ) -> None:
        self.sums: dict[str, str] = {}
        self._on_progress = on_progress
        self._num_done = 0
        self._view = view
        self._database = database
        self._target = target
        self._shards: dict[str, list[dict[str, Any]]] = defaultdict(list)  # by file; several list a compacted one
        for row in manifests.shard_table(view.files, view.snapshot).to_pylist():
            for name in row["files"]:
                self._shards[name].append(row)

    def write(self) -> None:
        """Write all files, SHA256SUMS last."""
        query = "SELECT r.* FROM metadata_rows AS r SEMI JOIN members USING (scenario_id)"
        members = self._database.members.select(["scenario_id"])
        rows = self._view.engine.arrow(query, tables={"members": members})
        records = [self._write_shard(f"packed-{k}", group) for k, group in enumerate(self._by_shard(rows))]
        records += self._write_shared_maps(rows)
        files = self._view.files
        used = user_columns.parse(self._database.lineage.user_columns).items()
        existing = {(name, version) for name, version in used if version in user_columns.versions(files, name)}
        for name, version in sorted(existing | self._view.user_columns.items()):
            ids = rows["scenario_id"].combine_chunks()
            path = user_columns.copy_rows(files, self._target, name, version, ids)
            self.sums[path] = sha256(self._target.path(path))
        for path in kept_moments.copy_newest(files, self._target, rows):
            self.sums[path] = sha256(self._target.path(path))
        self._write_lists(records)
        ancestors = lineage_tree(self._view, self._database).ancestors()
        lineages = {each.reference: each.lineage for each in ancestors if each.lineage is not None}
        self._publish(pack_origins.write(self._target, self._database.reference, lineages), pack_origins.FILE)
        card = self._target.temporary()
        with writing(card, card):
            card.write_text(make_card(self._database.reference, rows, self.sums), "utf-8")
        self._publish(card, CARD)
        _write_sums(self._target, self.sums)
        shutil.rmtree(self._target.path(".tmp"))

    def _publish(self, temporary: Path, name: str) -> None:
        self.sums[name] = sha256(temporary)
        self._target.publish(temporary, name)

    # --- shards -------------------------------------------------------------------------------------

    def _by_shard(self, rows: pa.Table) -> Iterator[pa.Table]:
        """Yield the rows of each new shard, in the order of their files in the lake."""
        options = [self._shards[name][0]["options"] for name in rows["tracks_file"].to_pylist()]
        listed = rows.append_column("options", pa.array(options, pa.string()))
        listed = listed.sort_by([(name, "ascending") for name in (*_SHARD, "tracks_file", "tracks_row_group")])
        groups = list(zip(*(listed[name].to_pylist() for name in _SHARD), strict=True))
        starts = [k for k, group in enumerate(groups) if not k or group != groups[k - 1]]
        for start, end in zip(starts, [*starts[1:], len(groups)], strict=True):
            yield listed.slice(start, end - start)

    def _write_shard(self, name: str, rows: pa.Table) -> ShardRecord:
        """Write one shard, of rows that were converted by the same version with the same options."""
        first = {column: rows[column][0].as_py() for column in _SHARD}
        sources = {str(row["key"]): row for file in rows["tracks_file"].to_pylist() for row in self._shards[file]}
        inputs = {i: f for s in sources.values() for i, f in zip(s["items"], s["fingerprints"], strict=True)}
        folder = (first["dataset"], first["version"], first["split"])
        footer = provenance(self._view.files, [str(source["metadata_file"]) for source in sources.values()]) | {
            "scenarionet.licence": "; ".join(sorted(set(rows["licence"].to_pylist()))),
        }
        writer, chunks = FileWriter(self._view.files, self._target, folder, name, footer), []
        for start in range(0, rows.num_rows, SCENARIOS_PER_FILE):
            chunks.append(writer.write(rows.slice(start, SCENARIOS_PER_FILE)))
            self._num_done += chunks[-1].num_rows
            if self._on_progress:
                self._on_progress(self._num_done, 2 * len(self._database), self._num_done // 2)
        is_whole = rows.num_rows == sum(int(source["num_scenarios"]) for source in sources.values())
        record = self._record(
            name=name,
            **{column: first[column] for column in _SHARD},
            max_scenarios=None if is_whole else rows.num_rows,
            items=list(inputs),
            fingerprints=list(inputs.values()),
            num_scenarios=rows.num_rows,
            published=writer.published,
            metadata_folder=partition("metadata", *folder),
        )
        footer |= {"scenarionet.source": " ".join((*folder, name))}
        content = pa.concat_tables(chunks).drop_columns(["options"])
        footer |= {"scenarionet.shard": json.dumps(asdict(record))}
        name = str(record.metadata_file)
        publish_table(self._target, "metadata", content, footer, name, row_group_size=_ROWS_PER_GROUP)
        self.sums[name] = sha256(self._target.path(name))
        return record

    def _record(self, *, published: Sequence[Sealed], metadata_folder: str | None, **fields: Any) -> ShardRecord:
        """Return the record of a packed shard; its key depends on its files."""
        self.sums.update((each.name, each.checksum) for each in published)
        listed = [[each.name for each in published], [each.checksum for each in published]]
        content = json.dumps([fields, *listed], sort_keys=True)
        key = hashlib.blake2b(content.encode(), digest_size=8).hexdigest()
        record = ShardRecord(
            key=key,
            schemas=tables.content_tag(),
            num_quarantined=0,
            metadata_file=f"{metadata_folder}/{fields['name']}-{key}.parquet" if metadata_folder else None,
            files=[],
            sizes=[],
            checksums=[],
            **fields,
        )
        return with_files(record, published)

    # --- maps, user columns, lists ------------------------------------------------------------------

    def _write_shared_maps(self, rows: pa.Table) -> Iterator[ShardRecord]:
        """Write the tiles of shared maps in the windows of members, map by map; yield their shard records."""
        names = self._view.shared_maps()
        for (dataset, version, map_id), listed in sorted(tiles.windows(rows).items()):
            source = names[dataset, version, map_id]
            record = self._shards[source][0]
            temporary = self._target.temporary()
            numbers = tiles.tiles_in(self._view.files, source, listed)
            copy_groups(self._view.files, "maps", source, numbers, temporary, MAP_FOOTER)
            stem = f"{partition('maps', dataset, version, '')}/{map_id}"
            same = ("dataset", "version", "split", "name", "options", "converter_version", "items", "fingerprints")
            yield self._record(
                **{field: record[field] for field in same},
                max_scenarios=None,
                num_scenarios=0,
                published=[publish_data(self._target, temporary, stem)],
                metadata_folder=None,
            )

    def _write_lists(self, records: list[ShardRecord]) -> None:
        """Write the database, the manifest, and the snapshot, with its number in the lake for the lineage."""
        file = self._database.file
        if self._database.rows is None:
            temporary = self._target.temporary()
            copy_sealed(self._view.files, file, temporary, self._target.place_to_write(file))
            self._publish(temporary, file)
        else:  # of files that the pack does not have
            members, lineage = self._database.members, self._database.lineage
            footer = {"scenarionet.lineage": json.dumps(lineage.to_dict())}
            publish_table(self._target, "members", members, footer, file, row_group_size=_ROWS_PER_GROUP)
            self.sums[file] = sha256(self._target.path(file))
        following = Snapshot(
            number=self._view.snapshot.number,
            created_at=snapshots.now(),
            operation=f"pack {self._database.reference}",
            metadata=tuple(record.metadata_file for record in records if record.metadata_file is not None),
            manifests=manifests.write(self._target, snapshots.EMPTY, records, frozenset()),
        )
        snapshots.publish(self._target, following)
        for name in (IDENTITY, *self._target.names("snapshots")):
            self.sums[name] = sha256(self._target.path(name))
