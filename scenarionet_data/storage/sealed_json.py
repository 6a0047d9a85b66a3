"""JSON files that verify themselves: snapshots and descriptions of evaluation runs.

The last entry, ``digest``, is the XXH3-128 of the file's bytes with zeros in its place, followed by the file's name
relative to the lake, so that two files that were exchanged are found as well. ``format`` is 2; files of older lakes
have neither this format nor a digest.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from xxhash import xxh3_128

FORMAT = 2
_ZEROS = b"0" * 32


class NewerFormat(Exception):
    """A file was written by a newer version of this software."""


def seal(content: Mapping[str, Any], name: str) -> bytes:
    """Bytes of a JSON file with its format and digest.

    Args:
        content: JSON-serialisable.
        name: Name of the file, relative to the lake.
    """
    blank = json.dumps({"format": FORMAT, **content, "digest": _ZEROS.decode()}, indent=1).encode()
    head, _, end = blank.rpartition(_ZEROS)
    return head + _digest(blank, name).encode() + end


def read(data: bytes, name: str) -> tuple[dict[str, Any], bool]:
    """Content of a JSON file without format and digest, and whether it is sealed, and therefore verified.

    Args:
        data: Bytes of the file.
        name: Its name, relative to the lake.

    Raises:
        ValueError: It is damaged, or not the file that was published under this name; the message states the reason.
        NewerFormat: It is intact, and of a format that this version does not know.
    """
    try:
        content = json.loads(data)
    except RecursionError as error:
        raise ValueError("its JSON is nested too deeply") from error
    if not isinstance(content, dict):
        raise ValueError("it holds no JSON object")
    version, digest = content.pop("format", 1), content.pop("digest", None)
    if digest is None and version == 1:
        return content, False
    if version != FORMAT and digest is None:
        raise NewerFormat(f"written in format {version!r}, not {FORMAT}")
    head, found, end = data.rpartition(str(digest).encode())
    if not found or digest != _digest(head + _ZEROS + end, name):
        raise ValueError("its bytes differ from those that were written under this name")
    if version != FORMAT:
        raise NewerFormat(f"written in format {version!r}, not {FORMAT}")
    return content, True


def _digest(blank: bytes, name: str) -> str:
    return xxh3_128(blank + name.encode()).hexdigest()
