"""Headers of pages, which no checksum covers: readers allocate what they say."""

from __future__ import annotations

from typing import Any

from scenarionet_data.storage.integrity.footers import structs
from scenarionet_data.storage.integrity.footers.thrift import Decoder, Malformed

_KINDS = {structs.DATA_PAGE: "data", structs.DATA_PAGE_V2: "data_v2"}


def check_headers(content: memoryview, start: int, end: int, num_values: int, size: int) -> None:
    """Check the headers of a column chunk's pages: places, sizes and number of values.

    Args:
        content: The bytes.
        start, end: Position of the column chunk in them.
        num_values: Its number of values, with nulls and empty lists, in the footer.
        size: Its uncompressed size in the footer.

    Raises:
        Malformed: A header differs from what the footer says.
    """
    if not 0 <= start <= end <= len(content):
        raise Malformed("its pages are not in the file")
    decoder, found, total = Decoder(content, start, end), 0, 0
    while decoder.left:
        begin, header = decoder.at, structs.read_page_header(decoder)
        if header["stored_size"] > decoder.left:
            raise Malformed(f"a page of {header['stored_size']:,} bytes where {decoder.left:,} are left")
        total += decoder.at - begin + header["size"]
        decoder.at += header["stored_size"]
        if header["page"] != structs.DICTIONARY_PAGE or "dictionary" not in header:
            found += _data_header(header)["num_values"]
    if found != num_values or total > size:
        raise Malformed(f"pages of {found:,} values and {total:,} bytes, other than in the footer")


def check_chunk(content: memoryview, column: dict[str, Any]) -> None:
    """Check the headers of a column chunk's pages against its footer, see :func:`.checks.check_footer`.

    Args:
        content: Bytes of the file up to the footer.
        column: What the footer says of the column chunk.

    Raises:
        Malformed: A header differs from it.
    """
    start = column.get("dictionary_page", column["data_page"])
    end = start + column["stored_size"]
    check_headers(content, start, end, column["num_values"], column["size"])


def _data_header(header: dict[str, Any]) -> dict[str, Any]:
    """The part of a page header that describes a data page."""
    kind = _KINDS.get(header["page"])
    if kind is None or kind not in header:
        raise Malformed("a page of an unknown kind")
    page: dict[str, Any] = header[kind]
    if kind == "data" and {page["definition_encoding"], page["repetition_encoding"]} != {structs.RLE}:
        raise Malformed("levels in another encoding than written")
    return page
