"""Write one shard: at most 64 scenarios per file, one row group each; the metadata file is published last.

The result depends on the shard alone, so two jobs that write the same shard publish identical files.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from itertools import chain
from operator import itemgetter
from pathlib import Path
from typing import Any, NamedTuple

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
from scenarionet_data.storage.snapshots.shard_record import ShardRecord, make_record, partition
from scenarionet_data.storage.write.table_file import defect_rows, publish_data, publish_table, write_table

SCENARIOS_PER_FILE = 64
"""A footer with 64 row groups is read in 0.7 ms, one with 250 in 2-4 ms."""

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
        self._waiting: dict[int, Encoded] = {}
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
            for value in encoded.metadata.values():
                if isinstance(value, str):
                    value.encode()
        except UnicodeEncodeError as error:
            found = str(error.object)[error.start : error.end]
            raise InvalidScenario(scenario.id, "text", f"expected UTF-8 in all texts, found {found!a}") from error
        position = len(self._ids) + len(self._rejected)
        self._ids.add(scenario.id)
        self._defects[scenario.id] = defect_rows(self._shard, scenario.defects, scenario_id=scenario.id)
        self._waiting[position] = encoded
        for table in tables.LOADED:
            rows = getattr(encoded, table)
            self._num_bytes += 0 if rows is None else rows.get_total_buffer_size()
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
        defects = list(chain.from_iterable(self._defects.values()))
        for table, rows in (("quarantine", sorted(self._rejected, key=itemgetter("position"))), ("defects", defects)):
            if rows:
                temporary = write_table(self._files, table, rows, self._footer)
                self._published.append(publish_data(self._files, temporary, self._stem(table)))
        record = make_record(
            self._shard,
            self._version,
            self._published,
            num_scenarios=len(self._rows),
            num_quarantined=len(self._rejected),
            max_scenarios=max_scenarios,
        )
        footer = {**self._footer, "scenarionet.shard": json.dumps(vars(record))}
        publish_table(self._files, "metadata", self._rows, footer, str(record.metadata_file))
        return record

    def abandon(self) -> None:
        """Remove unfinished files; published files of an unfinished shard are never referenced."""
        for path, writer, _ in self._parts.values():
            with suppress(OSError):  # on a full disk the footer cannot be written, and is not needed
                writer.close()
            path.unlink(missing_ok=True)
        self._parts.clear()

    # --- parts --------------------------------------------------------------------------------------

    def _write_waiting(self) -> None:
        """Audit the batch, and write or reject each scenario."""
        waiting, self._waiting, self._num_bytes = self._waiting, {}, 0
        refused = self._audit(list(waiting.values())) if self._audit and waiting else {}
        for number, (position, encoded) in enumerate(waiting.items()):
            if number in refused:
                self._ids.remove(encoded.metadata["scenario_id"])
                del self._defects[encoded.metadata["scenario_id"]]
                self.reject(position, refused[number])
                continue
            row = dict(encoded.metadata)
            for table in tables.LOADED:
                batch = getattr(encoded, table)
                row[f"{table}_num_rows"] = 0 if batch is None else batch.num_rows
                if row[f"{table}_num_rows"]:
                    row[f"{table}_row_group"], row[f"{table}_first_row"] = self._write(table, batch), 0
            self._pending.append(row)
            if len(self._pending) == SCENARIOS_PER_FILE:
                self._close_parts()

    def _write(self, table: str, batch: pa.RecordBatch) -> int:
        """Write a scenario's rows as one row group of the open file; returns its number."""
        if table not in self._parts:
            path = self._files.temporary()
            with writing(path):
                self._parts[table] = _OpenPart(path, tables.load(table).writer(path, self._footer, batch), [])
        path, writer, written = self._parts[table]
        with writing(path):
            writer.write_batch(batch, row_group_size=batch.num_rows)
        written.append(batch.num_rows)
        return len(written) - 1

    def _close_parts(self) -> None:
        """Close, re-open, verify and publish the open files; enter their names in the pending metadata rows."""
        number = len(self._rows) // SCENARIOS_PER_FILE
        for table, (path, writer, written) in self._parts.items():
            with writing(path):
                writer.add_key_value_metadata({"scenarionet.num_scenarios": str(len(self._pending))})
                writer.close()
            footer = pq.read_metadata(path)
            found = [footer.row_group(place).num_rows for place in range(footer.num_row_groups)]
            if found != written:
                raise LakeError(f"{path}: wrote row groups of {written} rows, read back {found}; check the disk")
            self._published.append(publish_data(self._files, path, f"{self._stem(table)}-{number:03d}"))
            for row in self._pending:
                if row[f"{table}_num_rows"]:
                    row[f"{table}_file"] = self._published[-1].name
        self._parts.clear()
        self._rows += self._pending
        self._pending = []

    def _stem(self, table: str) -> str:
        """Name of the shard's files of a table, up to the number of the part."""
        return f"{partition(table, self._shard.dataset, self._shard.version, self._shard.split)}/{self._shard.name}"


def check_share_of_bad_rows(scenario: ScenarioDescription, limit: float) -> None:
    """Raise unless at most ``limit`` of the rows of a scenario's objects were dropped.

    Raises:
        InvalidScenario: The message states the share, the limit and the first reasons.
    """
    num_dropped, reasons = 0, list[str]()
    for each in scenario.defects:
        if (each.table, each.action) == ("tracks", "dropped"):
            num_dropped += each.count
            reasons.append(f"{each.file}, {each.location}: {each.field}: {each.reason}")
    num_kept = scenario.num_recorded_rows
    num_rows = num_dropped + (int(scenario.tracks.valid.sum()) if num_kept is None else num_kept)
    if num_dropped > limit * num_rows:
        raise InvalidScenario(
            scenario.id,
            "tracks",
            f"expected at most {limit:.0%} unusable rows (option max_bad_rows), found {num_dropped / num_rows:.1%}, "
            f"{num_dropped:,} of {num_rows:,}: {'; '.join(reasons[:3])}",
        )


class _OpenPart(NamedTuple):
    """An open file of one table, and the number of rows of each row group written so far."""

    path: Path
    writer: pq.ParquetWriter
    written: list[int]
