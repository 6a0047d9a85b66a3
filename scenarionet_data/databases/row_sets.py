"""Members of databases of large lakes as bits, one for each row of a snapshot's metadata files.

Files never change, and ``vacuum`` keeps those of snapshots that databases were made on, so rows stay true. Ten million
members take 1.3 MB, and no id is read to save, combine or open them. Members whose order or weights are their own are
rows of ``schemas/members.toml`` instead, as are those of smaller lakes, whose ids cost nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import pyarrow as pa

from scenarionet_data.arrays.dtypes import Bool, Int32, Int64
from scenarionet_data.errors import LakeError
from scenarionet_data.schema import tables
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.read import metadata_rows

_FILE = 32
"""A row is number of its file << 32 | row in the file, where SQL selects it."""


@dataclass(frozen=True)
class RowSets:
    """Members of a database: sets of rows, one after the other, each in the order of ids.

    Attributes:
        metadata: Files of the metadata table.
        starts: (files + 1,) first row of each of them, and the number of all rows.
        sets: (rows,) for each set, whether the scenario of a row is in it; a row is in one set at most.
    """

    metadata: tuple[str, ...]
    starts: Int64
    sets: tuple[Bool, ...]

    @classmethod
    def every(cls, files: LakeFiles, metadata: Sequence[str]) -> RowSets:
        """All rows of some metadata files, as one set."""
        starts = metadata_rows.first_rows(files, metadata)
        return cls(tuple(metadata), starts, (np.ones(starts[-1], bool),))

    @classmethod
    def of_table(cls, rows: pa.Table) -> RowSets:
        """The members that :meth:`to_table` returned."""
        columns = {name: rows[name].to_pylist() for name in rows.column_names}
        num_files = columns["set"].count(0)
        counts = columns["num_rows"][:num_files]
        bits = [
            np.unpackbits(np.frombuffer(packed, np.uint8), count=count, bitorder="little").view(bool)
            for packed, count in zip(columns["bits"], columns["num_rows"], strict=True)
        ]
        sets = tuple(np.concatenate(bits[k : k + num_files]) for k in range(0, len(bits), num_files))
        return cls(tuple(columns["metadata_file"][:num_files]), np.cumsum([0, *counts]), sets)

    def to_table(self) -> pa.Table:
        """Rows of ``schemas/member_bits.toml``."""
        rows = [
            {"set": number, "metadata_file": name, "num_rows": end - start, "bits": packed.tobytes()}
            for number, each in enumerate(self.sets)
            for name, start, end in zip(self.metadata, self.starts, self.starts[1:], strict=False)
            for packed in [np.packbits(each[start:end], bitorder="little")]
        ]
        return pa.Table.from_pylist(rows, schema=tables.load("member_bits").schema)

    def __len__(self) -> int:
        return sum(map(np.count_nonzero, self.sets))

    @cached_property
    def union(self) -> Bool:
        """(rows,) whether the scenario of a row is a member."""
        return self.sets[0] if len(self.sets) == 1 else np.logical_or.reduce(self.sets)

    def where(self, wanted: Bool) -> RowSets:
        """The members of some rows."""
        return replace(self, sets=tuple(each & wanted for each in self.sets))

    def then(self, others: RowSets) -> RowSets:
        """These members, and after them those of others, of the same files, that are none of these."""
        return replace(self, sets=self.sets + others.where(~self.union).sets)

    def among(self, whole: RowSets) -> RowSets | None:
        """The same members as rows of other files; None if a file with members is not one of these."""
        if self.metadata == whole.metadata:
            return self
        sets = [np.zeros(whole.starts[-1], bool) for _ in self.sets]
        for name, start, end in zip(self.metadata, self.starts, self.starts[1:], strict=False):
            if name in whole.metadata:
                place = whole.starts[whole.metadata.index(name)]
                for number, each in enumerate(self.sets):
                    sets[number][place : place + end - start] = each[start:end]
            elif self.union[start:end].any():
                return None
        return RowSets(whole.metadata, whole.starts, tuple(sets))

    def ordered(self, files: LakeFiles) -> Int32:
        """(n,) rows of the members, in their order."""
        order = metadata_rows.order_of_ids(files, self.metadata)
        return np.concatenate([order[each[order]] for each in self.sets])

    def members(self, files: LakeFiles) -> pa.Table:
        """The members as rows of ``schemas/members.toml``.

        Raises:
            LakeError: A metadata file is missing or damaged.
        """
        rows = self.ordered(files)
        found = metadata_rows.rows_of(files, self.metadata, ["scenario_id", "content_hash"])
        if found.num_rows != self.starts[-1]:
            raise LakeError(f"{files.root}: metadata files have {found.num_rows:,} rows, expected {self.starts[-1]:,}")
        columns = found.take(rows).combine_chunks()
        numbers = pa.array(np.arange(len(rows), dtype=np.int32)), pa.array(np.ones(len(rows)))
        return tables.load("members").conform(
            columns.append_column("position", numbers[0]).append_column("weight", numbers[1])
        )

    # --- rows in SQL ------------------------------------------------------------------------------------

    def places(self, files: LakeFiles | None = None) -> pa.Table:
        """``lake_row`` of the members in the view metadata; with the lake's files in order, with their position."""
        if files is None:
            split = np.split(self.union, self.starts[1:-1])
            return pa.table(
                {"lake_row": np.concatenate([np.flatnonzero(each) + (k << _FILE) for k, each in enumerate(split)])}
            )
        rows = self.ordered(files)
        file = np.searchsorted(self.starts, rows, side="right") - 1
        position = np.arange(len(rows), dtype=np.int32)
        return pa.table({"lake_row": (file << _FILE) + rows - self.starts[file], "position": position})

    def rows(self, places: pa.Array) -> Int64:
        """(n,) rows of a column ``lake_row``."""
        numbers = places.to_numpy()
        found: Int64 = self.starts[numbers >> _FILE] + (numbers & (1 << _FILE) - 1)
        return found
