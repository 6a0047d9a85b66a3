"""Checks of the page headers in column chunks that Arrow decodes: it believes them, and no checksum covers them.

The pages themselves are compared with their checksums by Arrow.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import lru_cache

from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.storage.footers import structs
from scenarionet_data.storage.footers.pages import check_headers
from scenarionet_data.storage.footers.thrift import Malformed
from scenarionet_data.storage.read.parquet.page_kernels import (
    CHUNK_END,
    CHUNK_SIZE,
    CHUNK_START,
    DATA_START,
    EXPECTED,
    IS_CHECKED,
    NUM_VALUES,
)

_LONGEST = 48
"""Bytes of the fields of a header that are compared; statistics may follow."""
_VARINT = rb"\x15([\x80-\xff]*[\x00-\x7f])"
_DATA = re.compile(rb"\x15\x00" + 3 * _VARINT + rb"\x1c" + _VARINT + rb"\x15(.)\x15\x06\x15\x06", re.DOTALL)
"""Header of a data page: sizes, checksum, number of values, encoding, and levels in RLE."""
_DICTIONARY = re.compile(rb"\x15\x04" + 3 * _VARINT + rb"\x3c" + 2 * _VARINT)


def check_pages(content: Array, base: int, chunk: Sequence[int]) -> None:
    """Check the headers of a column chunk against the footer: places, sizes, number of values, encoding.

    Args:
        content: (n,) uint8 bytes of the file from position ``base`` on.
        base: Position of the first byte in the file.
        chunk: A row of ``Footer.chunks``.

    Raises:
        Malformed: A header differs from what the footer says.
    """
    if chunk[IS_CHECKED] and _is_as_written(content, base, chunk):
        return
    encodings = check_headers(
        content.data,
        chunk[CHUNK_START] - base,
        chunk[CHUNK_END] - base,
        chunk[NUM_VALUES],
        chunk[CHUNK_SIZE],
        has_checksums=bool(chunk[IS_CHECKED]),
    )
    # Arrow stops using a dictionary after the first page when another one follows.
    allowed = {chunk[EXPECTED], *([structs.PLAIN] if len(encodings) > 1 else [])}
    if chunk[IS_CHECKED] and not allowed.issuperset(encodings):
        raise Malformed("a page in an encoding that the footer does not list")


def _is_as_written(content: Array, base: int, chunk: Sequence[int]) -> bool:
    """Whether a column chunk is one data page of the expected encoding, after a dictionary or not; in 3 us."""
    start, middle, end = chunk[CHUNK_START] - base, chunk[DATA_START] - base, chunk[CHUNK_END] - base
    stored = content.data
    if not 0 <= start <= middle <= end <= len(content):
        return False
    if start < middle:
        words = _DICTIONARY.match(bytes(stored[start : start + _LONGEST]))
        if not words or _number(words[1]) > chunk[CHUNK_SIZE] or _number(words[2]) > middle - start:
            return False
    page = _DATA.match(bytes(stored[middle : middle + _LONGEST]))
    return page is not None and (
        _number(page[1]) <= chunk[CHUNK_SIZE]
        and _number(page[2]) <= end - middle
        and _number(page[4]) == chunk[NUM_VALUES]
        and _number(page[5]) == chunk[EXPECTED]
    )


@lru_cache(4096)
def _number(varint: bytes) -> int:
    """A number that is not negative."""
    value = 0
    for place, byte in enumerate(varint):
        value |= (byte & 127) << 7 * place
    return value >> 1
