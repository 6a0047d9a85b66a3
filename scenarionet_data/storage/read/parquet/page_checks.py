"""Checks of the page headers in column chunks that Arrow decodes: it believes them, and no checksum covers them.

The pages themselves are compared with their checksums by Arrow.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.storage.footers import structs
from scenarionet_data.storage.footers.thrift import Decoder, Malformed
from scenarionet_data.storage.read.parquet import page_kernels as kernels

_KINDS = {structs.DATA_PAGE: "data", structs.DATA_PAGE_V2: "data_v2"}
_LONGEST = 80
"""Bytes of the fields of a header that are compared; statistics may follow."""
_NUMBER, _DATA, _DICTIONARY = 0x15, 0x1C, 0x3C
"""Field headers of Thrift: a number in the next field, a struct in the next or third field after."""


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
        words = _numbers(content[start : start + _LONGEST].tobytes(), _DICTIONARY, 2)
        if words is None or words[0] != structs.DICTIONARY_PAGE or words[2] > middle - start:
            return False
        if words[1] > chunk[kernels.CHUNK_SIZE]:
            return False
    page = _numbers(content[middle : middle + _LONGEST].tobytes(), _DATA, 4)
    if page is None:
        return False
    kind, size, stored, _, num_values, encoding, *levels = page
    return (
        kind == structs.DATA_PAGE
        and size <= chunk[kernels.CHUNK_SIZE]
        and stored <= end - middle
        and num_values == chunk[kernels.NUM_VALUES]
        and encoding == chunk[kernels.EXPECTED]
        and levels == [structs.RLE, structs.RLE]
    )


def _numbers(header: bytes, inner: int, count: int) -> list[int] | None:
    """The first numbers of a page header with a checksum: 4, and ``count`` of the struct in it; None if it has others."""
    found, at = [], 0
    try:
        for place in range(4 + count):
            if place == 4:
                if header[at] != inner:
                    return None
                at += 1
            if header[at] != _NUMBER:
                return None
            value, shift, at = header[at + 1] & 127, 7, at + 2
            while header[at - 1] > 127:
                value |= (header[at] & 127) << shift
                shift, at = shift + 7, at + 1
            found.append(value >> 1)
    except IndexError:
        return None
    return found


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
