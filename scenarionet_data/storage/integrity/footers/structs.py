"""Structs of Parquet footers and page headers, as far as files of this package use them.

Format: https://github.com/apache/parquet-format/blob/master/src/main/thrift/parquet.thrift. StructFields for
encryption, for other files and for geometries are missing here on purpose: a footer that has them is refused.
"""

from __future__ import annotations

from typing import Any

from scenarionet_data.storage.integrity.footers.thrift import (
    ANY_INT,
    BINARY,
    BYTE,
    COUNT,
    SIZE,
    TEXT,
    TRUTH,
    Decoder,
    Field,
    Malformed,
    StructFields,
    integers,
    lists,
    one_of,
    structs,
)

UNCOMPRESSED, SNAPPY, GZIP, BROTLI, ZSTD, LZ4 = 0, 1, 2, 4, 6, 7
PLAIN, PLAIN_DICTIONARY, RLE, RLE_DICTIONARY, BYTE_STREAM_SPLIT = 0, 2, 3, 8, 9
DATA_PAGE, DICTIONARY_PAGE, DATA_PAGE_V2 = 0, 2, 3
REQUIRED, OPTIONAL, REPEATED = 0, 1, 2
BYTE_ARRAY, FIXED_LEN_BYTE_ARRAY = 6, 7

_TYPE = one_of(*range(8))
_ENCODING = one_of(0, *range(2, 10))
_PAGE = one_of(*range(4))
_COUNTS = lists(integers(64, 0, 2**62))

_STATISTICS: StructFields = {
    1: Field("max", BINARY),
    2: Field("min", BINARY),
    3: Field("null_count", SIZE),
    4: Field("distinct_count", SIZE),
    5: Field("max_value", BINARY),
    6: Field("min_value", BINARY),
    7: Field("is_max_exact", TRUTH),
    8: Field("is_min_exact", TRUTH),
}

_EMPTY = structs("an annotation", {})
_UNIT = structs("a unit of time", {number: Field(f"unit {number}", _EMPTY) for number in (1, 2, 3)})
_TIME = structs("a time type", {1: Field("is_utc", TRUTH, True), 2: Field("unit", _UNIT, True)})
_LOGICAL_TYPE: StructFields = {
    1: Field("string", _EMPTY),
    3: Field("list", _EMPTY),
    4: Field("enum", _EMPTY),
    5: Field(
        "decimal",
        structs("a decimal type", {1: Field("scale", COUNT, True), 2: Field("precision", COUNT, True)}),
    ),
    6: Field("date", _EMPTY),
    7: Field("time", _TIME),
    8: Field("timestamp", _TIME),
    10: Field(
        "integer", structs("an integer type", {1: Field("bits", BYTE, True), 2: Field("is_signed", TRUTH, True)})
    ),
    11: Field("unknown", _EMPTY),
    12: Field("json", _EMPTY),
}

_SCHEMA_ELEMENT: StructFields = {
    1: Field("type", _TYPE),
    2: Field("type_length", COUNT),
    3: Field("repetition", one_of(REQUIRED, OPTIONAL, REPEATED)),
    4: Field("name", TEXT, True),
    5: Field("num_children", COUNT),
    6: Field("converted_type", one_of(*range(22))),
    7: Field("scale", COUNT),
    8: Field("precision", COUNT),
    9: Field("field_id", ANY_INT),
    10: Field("logical_type", structs("a logical type", _LOGICAL_TYPE)),
}

_ENCODING_STATS: StructFields = {
    1: Field("page", _PAGE, True),
    2: Field("encoding", _ENCODING, True),
    3: Field("count", COUNT, True),
}

_SIZES: StructFields = {
    1: Field("unencoded_bytes", SIZE),
    2: Field("repetition_levels", _COUNTS),
    3: Field("definition_levels", _COUNTS),
}

_KEY_VALUE: StructFields = {1: Field("key", TEXT, True), 2: Field("value", TEXT)}

_COLUMN: StructFields = {
    1: Field("type", _TYPE, True),
    2: Field("encodings", lists(_ENCODING), True),
    3: Field("path", lists(TEXT), True),
    4: Field("codec", one_of(UNCOMPRESSED, SNAPPY, GZIP, BROTLI, ZSTD, LZ4), True),
    5: Field("num_values", SIZE, True),
    6: Field("size", SIZE, True),
    7: Field("stored_size", SIZE, True),
    8: Field("key_values", lists(structs("an entry", _KEY_VALUE))),
    9: Field("data_page", SIZE, True),
    11: Field("dictionary_page", SIZE),
    12: Field("statistics", structs("statistics", _STATISTICS)),
    13: Field("encoding_stats", lists(structs("encoding statistics", _ENCODING_STATS))),
    16: Field("sizes", structs("size statistics", _SIZES)),
}

_CHUNK: StructFields = {2: Field("file_offset", SIZE, True), 3: Field("column", structs("a column", _COLUMN), True)}

_ROW_GROUP: StructFields = {
    1: Field("chunks", lists(structs("a column chunk", _CHUNK)), True),
    2: Field("size", SIZE, True),
    3: Field("num_rows", SIZE, True),
    5: Field("file_offset", SIZE),
    6: Field("stored_size", SIZE),
    7: Field("ordinal", integers(16, 0, 2**15 - 1)),
}

_ORDER = structs("a column order", {1: Field("type_order", _EMPTY)})

_FOOTER: StructFields = {
    1: Field("version", one_of(1, 2), True),
    2: Field("schema", lists(structs("a schema element", _SCHEMA_ELEMENT)), True),
    3: Field("num_rows", SIZE, True),
    4: Field("row_groups", lists(structs("a row group", _ROW_GROUP)), True),
    5: Field("key_values", lists(structs("an entry", _KEY_VALUE))),
    6: Field("created_by", TEXT),
    7: Field("orders", lists(_ORDER)),
}

_DATA_HEADER: StructFields = {
    1: Field("num_values", COUNT, True),
    2: Field("encoding", _ENCODING, True),
    3: Field("definition_encoding", _ENCODING, True),
    4: Field("repetition_encoding", _ENCODING, True),
    5: Field("statistics", structs("statistics", _STATISTICS)),
}

_DATA_HEADER_V2: StructFields = {
    1: Field("num_values", COUNT, True),
    2: Field("num_nulls", COUNT, True),
    3: Field("num_rows", COUNT, True),
    4: Field("encoding", _ENCODING, True),
    5: Field("definition_size", COUNT, True),
    6: Field("repetition_size", COUNT, True),
    7: Field("is_compressed", TRUTH),
    8: Field("statistics", structs("statistics", _STATISTICS)),
}

_DICTIONARY_HEADER: StructFields = {
    1: Field("num_values", COUNT, True),
    2: Field("encoding", _ENCODING, True),
    3: Field("is_sorted", TRUTH),
}

_PAGE_HEADER: StructFields = {
    1: Field("page", _PAGE, True),
    2: Field("size", COUNT, True),
    3: Field("stored_size", COUNT, True),
    4: Field("crc", ANY_INT),
    5: Field("data", structs("a data page header", _DATA_HEADER)),
    7: Field("dictionary", structs("a dictionary page header", _DICTIONARY_HEADER)),
    8: Field("data_v2", structs("a data page header", _DATA_HEADER_V2)),
}


def read_footer(footer: bytes | memoryview) -> dict[str, Any]:
    """Read a footer.

    Args:
        footer: Its bytes, without the 8 bytes that follow it.

    Raises:
        Malformed: The bytes are no footer that this package writes.
    """
    decoder = Decoder(footer)
    found = decoder.struct("the footer", _FOOTER)
    if decoder.left:
        raise Malformed(f"the footer is followed by {decoder.left:,} bytes")
    return found


def read_page_header(decoder: Decoder) -> dict[str, Any]:
    """Read a page header.

    Raises:
        Malformed: The bytes are no page header that this package writes.
    """
    return decoder.struct("a page header", _PAGE_HEADER)
