"""Consistency of a Parquet footer with itself and with the size of its file.

Arrow trusts a footer that it can parse: an unknown codec ends the process, and a number of rows is allocated before the
rows are read. Footers of sealed files are compared with their digest instead.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from scenarionet_data.storage.integrity.footers import structs
from scenarionet_data.storage.integrity.footers.thrift import Malformed

_MAGIC = b"PAR1"
_MAX_DEPTH = 8
_RATIO = {structs.UNCOMPRESSED: 1, structs.LZ4: 255, structs.SNAPPY: 64, structs.GZIP: 1032, structs.BROTLI: 2**16}
_ZSTD_RATIO = 2**15
"""A block of zstd takes 4 bytes or more and holds at most 128 KiB."""
_HEADERS = 2**12
"""Uncompressed bytes of a column chunk that do not come out of its compressed ones: headers of pages."""
_WIDTHS = {1: 4, 2: 8, 3: 12, 4: 4, 5: 8}
"""Bytes of a value by physical type."""


class _Leaf(NamedTuple):
    """A column in the schema, with the greatest levels of Dremel's encoding: lists, and lists or nulls, around it."""

    path: list[str]
    type: int
    repetition: int
    definition: int


def check_footer(footer: bytes, end: int) -> list[dict[str, Any]]:
    """Check a footer.

    Args:
        footer: Its bytes, without the 8 bytes that follow it.
        end: Position of the footer in its file; the column chunks are before it.

    Returns:
        What it says of every column chunk, see :mod:`.structs`.

    Raises:
        Malformed: It is no footer that this package writes, or contradicts itself or the size of the file.
    """
    content = structs.read_footer(footer)
    leaves = list(_leaves(content["schema"]))
    orders = content.get("orders")
    if orders is not None and len(orders) != len(leaves):
        raise Malformed(f"the footer orders {len(orders)} columns of {len(leaves)}")
    for group in content["row_groups"]:
        _check_row_group(group, leaves, end)
    found = sum(group["num_rows"] for group in content["row_groups"])
    if content["num_rows"] != found:
        raise Malformed(f"the footer says {content['num_rows']:,} rows, its row groups {found:,}")
    return [chunk["column"] for group in content["row_groups"] for chunk in group["chunks"]]


def _leaves(elements: Sequence[dict[str, Any]]) -> Iterator[_Leaf]:
    """Columns of a schema, which is stored as a tree in depth-first order."""
    if not elements or "type" in elements[0]:
        raise Malformed("the schema has no root")
    # Of each open group: the children that are still to come, and what is common to them.
    open_groups: list[tuple[int, _Leaf]] = [(_children(elements[0]), _Leaf([], 0, 0, 0))]
    for element in elements[1:]:
        while open_groups and not open_groups[-1][0]:
            open_groups.pop()
        if not open_groups or len(open_groups) > _MAX_DEPTH:
            raise Malformed("the schema is no tree")
        left, parent = open_groups.pop()
        open_groups.append((left - 1, parent))
        path, repetition, children = [*parent.path, element["name"]], element.get("repetition"), _children(element)
        if ("type" in element) == (children > 0) or repetition is None:
            raise Malformed(f"the schema has a column {'.'.join(path)} without a type")
        if len(element.get("logical_type", {})) > 1:
            raise Malformed(f"the schema has a column {'.'.join(path)} of two types")
        found = _Leaf(
            path,
            element.get("type", 0),
            parent.repetition + (repetition == structs.REPEATED),
            parent.definition + (repetition != structs.REQUIRED),
        )
        if children:
            open_groups.append((children, found))
        else:
            yield found
    if any(left for left, _ in open_groups):
        raise Malformed("the schema has fewer columns than it says")


def _children(element: dict[str, Any]) -> int:
    found: int = element.get("num_children", 0)
    return found


def _check_row_group(group: dict[str, Any], leaves: Sequence[_Leaf], end: int) -> None:
    if len(group["chunks"]) != len(leaves):
        raise Malformed(f"a row group of {len(group['chunks'])} columns where the schema has {len(leaves)}")
    columns = [chunk["column"] for chunk in group["chunks"]]
    num_rows, largest = group["num_rows"], max((column["size"] for column in columns), default=0)
    if num_rows > 8 * largest:  # every table has a column without nulls, and a value takes a bit or more
        raise Malformed(f"{num_rows:,} rows in columns of at most {largest:,} bytes")
    for column, leaf in zip(columns, leaves, strict=True):
        name = ".".join(leaf.path)
        if column["path"] != leaf.path or column["type"] != leaf.type:
            raise Malformed(f"a column {'.'.join(column['path'])} where the schema has {name}")
        _check_position(column, name, end)
        _check_statistics(column, leaf)
        num_values = column["num_values"]
        # A list that is null or empty has one level; every other level has a value.
        most = num_rows if not leaf.repetition else num_rows + 8 * column["size"]
        if not num_rows <= num_values <= most:
            raise Malformed(f"{num_values:,} values of {name} in {num_rows:,} rows and {column['size']:,} bytes")


def _check_position(column: dict[str, Any], name: str, end: int) -> None:
    data, stored, size = column["data_page"], column["stored_size"], column["size"]
    first = column.get("dictionary_page", data)
    if not len(_MAGIC) <= first <= data < first + stored <= end:
        raise Malformed(f"{stored:,} bytes of {name} from {first:,} on, before a footer at {end:,}")
    if size > _RATIO.get(column["codec"], _ZSTD_RATIO) * stored + _HEADERS:
        raise Malformed(f"{size:,} bytes of {name} in {stored:,}")


def _check_statistics(column: dict[str, Any], leaf: _Leaf) -> None:
    width = _WIDTHS.get(leaf.type)
    statistics = column.get("statistics", {})
    for bound in ("min", "max", "min_value", "max_value"):
        if width and bound in statistics and len(statistics[bound]) != width:
            raise Malformed(f"a least or greatest value of {len(statistics[bound])} bytes for {'.'.join(leaf.path)}")
    sizes = column.get("sizes", {})
    for levels, most in (("repetition_levels", leaf.repetition), ("definition_levels", leaf.definition)):
        if len(sizes.get(levels, ())) not in (0, most + 1):
            raise Malformed(f"{len(sizes[levels])} levels of {'.'.join(leaf.path)}, which has {most + 1}")
    if "unencoded_bytes" in sizes and leaf.type != structs.BYTE_ARRAY:
        raise Malformed(f"the number of bytes of texts for {'.'.join(leaf.path)}, which has none")
