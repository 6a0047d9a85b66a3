"""Checks of the page headers in column chunks that Arrow decodes: it believes them, and no checksum covers them.

The pages themselves are compared with their checksums by Arrow.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.storage.footers import structs
from scenarionet_data.storage.footers.thrift import Decoder, Malformed
from scenarionet_data.storage.read.parquet import page_kernels as kernels

_KINDS = {structs.DATA_PAGE: "data", structs.DATA_PAGE_V2: "data_v2"}
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
    start, end = chunk[kernels.CHUNK_START] - base, chunk[kernels.CHUNK_END] - base
    if not 0 <= start <= end <= len(content):
        raise Malformed("its pages are not in the file")
    if not (chunk[kernels.IS_CHECKED] and _is_as_written(content, base, chunk)):
        _check_any(content, start, end, chunk)


def _is_as_written(content: Array, base: int, chunk: Sequence[int]) -> bool:
    """Whether a column chunk is one data page of the expected encoding, after a dictionary or not; in 5 us."""
    start, middle, end = (chunk[part] - base for part in (kernels.CHUNK_START, kernels.DATA_START, kernels.CHUNK_END))
    if start < middle:
        words = _DICTIONARY.match(content[start : start + _LONGEST].tobytes())
        if not words or _number(words[1]) > chunk[kernels.CHUNK_SIZE] or _number(words[2]) > middle - start:
            return False
    page = _DATA.match(content[middle : middle + _LONGEST].tobytes())
    return page is not None and (
        _number(page[1]) <= chunk[kernels.CHUNK_SIZE]
        and _number(page[2]) <= end - middle
        and _number(page[4]) == chunk[kernels.NUM_VALUES]
        and _number(page[5]) == chunk[kernels.EXPECTED]
    )


def _number(varint: bytes) -> int:
    """A number that is not negative."""
    value = 0
    for place, byte in enumerate(varint):
        value |= (byte & 127) << 7 * place
    return value >> 1


def _check_any(content: Array, start: int, end: int, chunk: Sequence[int]) -> None:
    """Check the headers of any number of pages."""
    decoder = Decoder(content.data, start, end)
    num_values, size, encodings = 0, 0, []
    while decoder.left:
        begin, header = decoder.at, structs.read_page_header(decoder)
        if header["stored_size"] > decoder.left:
            raise Malformed(f"a page of {header['stored_size']:,} bytes where {decoder.left:,} are left")
        if chunk[kernels.IS_CHECKED] and "crc" not in header:
            raise Malformed("a page without a checksum")
        size += decoder.at - begin + header["size"]
        decoder.at += header["stored_size"]
        if header["page"] != structs.DICTIONARY_PAGE or "dictionary" not in header:
            page = _data_header(header)
            num_values += page["num_values"]
            encodings.append(page["encoding"])
    if num_values != chunk[kernels.NUM_VALUES] or size > chunk[kernels.CHUNK_SIZE]:
        raise Malformed(f"pages of {num_values:,} values and {size:,} bytes, other than in the footer")
    # Arrow stops using a dictionary after the first page when another one follows.
    allowed = {chunk[kernels.EXPECTED], *([structs.PLAIN] if len(encodings) > 1 else [])}
    if chunk[kernels.IS_CHECKED] and not allowed.issuperset(encodings):
        raise Malformed("a page in an encoding that the footer does not list")


def _data_header(header: dict[str, Any]) -> dict[str, Any]:
    """The part of a page header that describes a data page."""
    kind = _KINDS.get(header["page"])
    if kind is None or kind not in header:
        raise Malformed("a page of an unknown kind")
    page: dict[str, Any] = header[kind]
    if kind == "data" and {page["definition_encoding"], page["repetition_encoding"]} != {structs.RLE}:
        raise Malformed("levels in another encoding than written")
    return page
