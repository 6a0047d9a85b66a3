"""Write one shard: at most 64 scenarios per file, one row group each; the metadata file is published last.

The result depends on the shard alone, so two jobs that write the same shard publish identical files.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from scenarionet_data import codec
from scenarionet_data.codec import Encoded
from scenarionet_data.errors import InvalidScenario, LakeError
from scenarionet_data.ingest.shard import Shard
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.schema import tables
from scenarionet_data.storage.files.errors import writing
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.integrity.seals import Sealed
from scenarionet_data.storage.snapshots.shard_record import ShardRecord, metadata_name, partition, shard_key
from scenarionet_data.storage.write.table_file import defect_rows, publish_data, publish_table, write_table

SCENARIOS_PER_FILE = 64
"""A footer with 64 row groups is read in 0.7 ms, one with 250 in 2-4 ms."""

_SHARD_TABLES = ("tracks", "lights", "maps")
_MAX_WAITING = 256
_MAX_WAITING_BYTES = 64_000_000
"""Limits of a batch of scenarios for the audit (number, bytes); one audit costs at least 50 ms."""

Audit = Callable[[Sequence[Encoded]], Mapping[int, InvalidScenario]]
"""Checks encoded scenarios before they are written; returns an error for each rejected position."""


class ShardWriter:
    """Collects a shard's scenarios and publishes them with :meth:`finish`.

    Args:
        files: The lake's files.
        shard: The shard.
        converter_version: Version of the converter.
        licence: Licence of the recordings, written to every footer.
        audit: Checks scenarios before they are written; rejected ones go to quarantine.
    """

    def __init__(
        self, files: LakeFiles, shard: Shard, converter_version: str, licence: str, audit: Audit | None = None
    ) -> None:
        self._audit = audit
        self._files = files
        self._shard = shard
        self._version = converter_version
        self._footer = {
            "scenarionet.source": f"{shard.dataset} {shard.version} {shard.split} {shard.name}",
            "scenarionet.converter": f"{shard.dataset} {converter_version}",
            "scenarionet.fingerprints": json.dumps({item.name: item.fingerprint for item in shard.items}),
            "scenarionet.licence": licence,
            "scenarionet.frame": "scenario frame: metres, radians, seconds; x forward-east, y left, z up",
        }
        self._waiting: list[tuple[int, Encoded]] = []
        self._num_bytes = 0
        self._parts: dict[str, _OpenPart] = {}
        self._pending: list[dict[str, Any]] = []
        self._rows: list[dict[str, Any]] = []
        self._rejected: list[dict[str, Any]] = []
        self._defects: dict[str, list[dict[str, Any]]] = {}
        self._ids: set[str] = set()
        self._published: list[Sealed] = []

    @property
    def num_scenarios(self) -> int:
        """Scenarios added so far, including those that the audit will reject."""
        return len(self._ids)

    def add(self, scenario: ScenarioDescription) -> None:
        """Validate and encode one scenario; it is written in a batch.

        Raises:
            InvalidScenario: It is invalid, belongs to another shard, its id was added before, or too many of its rows
                were dropped (see ``Options.max_bad_rows``).
            LakeError: The lake cannot be written.
        """
        scenario.validate()
        check_share_of_bad_rows(scenario, self._shard.options.max_bad_rows)
        for name in ("dataset", "version", "split"):
            wanted, found = getattr(self._shard, name), getattr(scenario, name)
            if found != wanted:
                raise InvalidScenario(scenario.id, name, f"wanted {wanted!r}, its shard's, found {found!r}")
        if scenario.id in self._ids:
            raise InvalidScenario(scenario.id, "id", "expected a unique id, found it twice in this shard")
        try:
            encoded = codec.encode(scenario, self._version)
            "".join(value for value in encoded.metadata.values() if isinstance(value, str)).encode()
        except UnicodeEncodeError as error:
            found = str(error.object)[error.start : error.end]
            raise InvalidScenario(scenario.id, "text", f"expected UTF-8 in all texts, found {found!a}") from error
        position = len(self._ids) + len(self._rejected)
        self._ids.add(scenario.id)
        self._defects[scenario.id] = defect_rows(self._shard, scenario.defects, scenario_id=scenario.id)
        self._waiting.append((position, encoded))
        self._num_bytes += sum(rows.get_total_buffer_size() for rows in _batches(encoded).values())
        if len(self._waiting) == _MAX_WAITING or self._num_bytes > _MAX_WAITING_BYTES:
            self._write_waiting()

    def reject(self, position: int, error: Exception) -> None:
        """Quarantine the record at ``position`` with the error."""
        known = error if isinstance(error, InvalidScenario) else None
        self._rejected.append(
            {
                "dataset": self._shard.dataset,
                "version": self._shard.version,
                "split": self._shard.split,
                "shard": self._shard.name,
                "position": position,
                "scenario_id": known.scenario_id if known else None,
                "error": type(error).__name__,
                "field": known.field if known else None,
                "message": known.reason if known else str(error),
            }
        )

    def finish(self, max_scenarios: int | None = None, num_records: int | None = None) -> ShardRecord:
        """Publish everything, the metadata file last; returns the shard's record.

        Args:
            max_scenarios: Limit of the conversion.
            num_records: Records read from the source.

        Raises:
            LakeError: The number of records differs from that of converted and quarantined ones.
        """
        self._write_waiting()
        self._close_parts()
        if num_records not in (None, len(self._rows) + len(self._rejected)):
            kept = f"{len(self._rows)} scenarios and {len(self._rejected)} in quarantine"
            raise LakeError(f"{self._shard.name}: read {num_records} records, but kept {kept}; please report it")
        if self._rejected:
            self._publish_rows("quarantine", sorted(self._rejected, key=lambda row: int(row["position"])))
        if any(self._defects.values()):
            self._publish_rows("defects", [row for rows in self._defects.values() for row in rows])
        shard, key = self._shard, shard_key(self._shard, self._version)
        record = ShardRecord(
            key=key,
            dataset=shard.dataset,
            version=shard.version,
            split=shard.split,
            name=shard.name,
            options=shard.options_text,
            converter_version=self._version,
            schemas=tables.content_tag(),
            max_scenarios=max_scenarios,
            items=[item.name for item in shard.items],
            fingerprints=[item.fingerprint for item in shard.items],
            num_scenarios=len(self._rows),
            num_quarantined=len(self._rejected),
            metadata_file=metadata_name(shard, key),
            files=[sealed.name for sealed in self._published],
            sizes=[sealed.size for sealed in self._published],
            checksums=[sealed.checksum for sealed in self._published],
        )
        footer = {**self._footer, "scenarionet.shard": json.dumps(asdict(record))}
        publish_table(self._files, "metadata", self._rows, footer, metadata_name(shard, key))
        return record

    def abandon(self) -> None:
        """Remove unfinished files; published files of an unfinished shard are never referenced."""
        for part in self._parts.values():
            part.discard()
        self._parts.clear()

    # --- parts --------------------------------------------------------------------------------------

    def _write_waiting(self) -> None:
        """Audit the batch, and write or reject each scenario."""
        waiting, self._waiting, self._num_bytes = self._waiting, [], 0
        encoded = [each for _, each in waiting]
        refused = self._audit(encoded) if self._audit and encoded else {}
        for number, (position, each) in enumerate(waiting):
            if number in refused:
                self._ids.remove(each.metadata["scenario_id"])
                del self._defects[each.metadata["scenario_id"]]
                self.reject(position, refused[number])
                continue
            row, batches = dict(each.metadata), _batches(each)
            for table in _SHARD_TABLES:
                row.update(self._write(table, batches.get(table)))
            self._pending.append(row)
            if len(self._pending) == SCENARIOS_PER_FILE:
                self._close_parts()

    def _write(self, table: str, batch: pa.RecordBatch | None) -> dict[str, Any]:
        """Write a scenario's rows as one row group; returns its address columns except the file."""
        rows = 0 if batch is None else batch.num_rows
        address: dict[str, Any] = {f"{table}_num_rows": rows}
        if not rows:
            return address
        if table not in self._parts:
            self._parts[table] = _OpenPart(self._files.temporary(), table, self._footer, batch)
        address[f"{table}_row_group"] = self._parts[table].write(batch)
        address[f"{table}_first_row"] = 0
        return address

    def _close_parts(self) -> None:
        """Publish the open files and enter their names in the pending metadata rows."""
        number = len(self._rows) // SCENARIOS_PER_FILE
        for table, part in self._parts.items():
            part.close(len(self._pending))
            self._published.append(publish_data(self._files, part.path, f"{self._stem(table)}-{number:03d}"))
            for row in self._pending:
                if row[f"{table}_num_rows"]:
                    row[f"{table}_file"] = self._published[-1].name
        self._parts.clear()
        self._rows += self._pending
        self._pending = []

    def _publish_rows(self, table: str, rows: list[dict[str, Any]]) -> None:
        temporary = write_table(self._files, table, rows, self._footer)
        self._published.append(publish_data(self._files, temporary, self._stem(table)))

    def _stem(self, table: str) -> str:
        """Name of the shard's files of a table, up to the number of the part."""
        return f"{partition(table, self._shard.dataset, self._shard.version, self._shard.split)}/{self._shard.name}"


def check_share_of_bad_rows(scenario: ScenarioDescription, limit: float) -> None:
    """Raise unless at most ``limit`` of the rows of a scenario's objects were dropped.

    Raises:
        InvalidScenario: The message states the share, the limit and the first reasons.
    """
    dropped = [each for each in scenario.defects if (each.table, each.action) == ("tracks", "dropped")]
    num_dropped = sum(defect.count for defect in dropped)
    num_kept = scenario.num_recorded_rows
    num_rows = num_dropped + (int(scenario.tracks.valid.sum()) if num_kept is None else num_kept)
    if num_dropped > limit * num_rows:
        reasons = "; ".join(f"{each.file}, {each.location}: {each.field}: {each.reason}" for each in dropped[:3])
        raise InvalidScenario(
            scenario.id,
            "tracks",
            f"expected at most {limit:.0%} unusable rows (option max_bad_rows), found {num_dropped / num_rows:.1%}, "
            f"{num_dropped:,} of {num_rows:,}: {reasons}",
        )


def _batches(encoded: Encoded) -> dict[str, pa.RecordBatch]:
    """A scenario's rows by table."""
    return {name: getattr(encoded, name) for name in _SHARD_TABLES if getattr(encoded, name) is not None}


class _OpenPart:
    """An open file of one table."""

    def __init__(self, path: Path, table: str, footer: Mapping[str, str], first: pa.RecordBatch) -> None:
        self.path = path
        self._rows: list[int] = []
        with writing(path):
            self._writer = tables.load(table).writer(path, footer, first)

    def write(self, batch: pa.RecordBatch) -> int:
        """Append a row group; returns its number."""
        with writing(self.path):
            self._writer.write_batch(batch, row_group_size=batch.num_rows)
        self._rows.append(batch.num_rows)
        return len(self._rows) - 1

    def close(self, num_scenarios: int) -> None:
        """Close, re-open and verify."""
        with writing(self.path):
            self._writer.add_key_value_metadata({"scenarionet.num_scenarios": str(num_scenarios)})
            self._writer.close()
        footer = pq.read_metadata(self.path)
        found = [footer.row_group(number).num_rows for number in range(footer.num_row_groups)]
        if found != self._rows:
            raise LakeError(f"{self.path}: wrote row groups of {self._rows} rows, read back {found}; check the disk")

    def discard(self) -> None:
        """Remove the unfinished file."""
        with suppress(OSError):  # on a full disk the footer cannot be written, and is not needed
            self._writer.close()
        self.path.unlink(missing_ok=True)
