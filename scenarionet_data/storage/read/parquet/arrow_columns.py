"""Read columns of row groups with Arrow, in any encoding."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

import pyarrow as pa

from scenarionet_data.arrays.columns import ColumnLayout, Columns, from_arrow
from scenarionet_data.storage.integrity.footers.pages import check_headers
from scenarionet_data.storage.integrity.footers.thrift import Malformed
from scenarionet_data.storage.read.parquet.footer import RowGroup, UnreadableFile
from scenarionet_data.storage.read.parquet.page_kernels import CHUNK_END, CHUNK_SIZE, CHUNK_START, NUM_VALUES


def read_by_arrow(groups: Sequence[RowGroup], layout: ColumnLayout) -> Columns:
    """Read columns with Arrow; consecutive row groups in the same bytes are read in one call."""
    tables = []
    for _, run in groupby(groups, key=lambda group: (id(group.footer), id(group.content))):
        together = list(run)
        footer = together[0].footer
        names = [column.name for column in layout.columns if column.name not in footer.missing]
        names = names or [name for name in footer.names if name not in footer.missing][:1]  # for the number of rows
        _check_pages(together, names)
        try:
            file = together[0].open()
            tables.append(file.read_row_groups([group.number for group in together], names, use_threads=False))
            tables[-1].validate(full=True)  # texts are UTF-8
        except (OSError, pa.ArrowException) as error:
            raise UnreadableFile(footer.url, str(error)) from error
    return from_arrow(pa.concat_tables(tables, promote_options="default"), layout)


def _check_pages(groups: Sequence[RowGroup], names: Sequence[str]) -> None:
    """Check the page headers of columns without a digest before Arrow reads them, which believes them."""
    for group in groups:
        if group.footer.digests:
            continue
        chunks = dict(zip(group.footer.names, group.footer.stored(group.number).chunks.tolist(), strict=True))
        for name in names:
            try:
                chunk = chunks[name]
                start, end = chunk[CHUNK_START] - group.base, chunk[CHUNK_END] - group.base
                check_headers(group.content.data, start, end, chunk[NUM_VALUES], chunk[CHUNK_SIZE])
            except Malformed as error:
                raise UnreadableFile(group.footer.url, f"column {name}: {error}") from error
