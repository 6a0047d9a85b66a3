"""JSON files that verify themselves: snapshots, descriptions of runs, origins of packs.

The last entry, ``digest``, is the XXH3-128 of the file's bytes with zeros in its place, followed by the file's
:class:`.Place`. ``format`` is 3. Version 0.2 wrote format 2, whose digest covers the name alone, and version 0.1
no digest.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from xxhash import xxh3_128_hexdigest

from scenarionet_data.storage.integrity.file_end import Place
from scenarionet_data.storage.integrity.seals import covered

FORMAT = 3
_ZEROS = b"0" * 32


class NewerFormat(Exception):
    """A file was written by a newer version of this software."""


def seal(content: Mapping[str, Any], place: Place) -> bytes:
    """Bytes of a JSON file with its format and digest.

    Args:
        content: JSON-serialisable.
        place: Where it will be published.
    """
    blank = json.dumps({"format": FORMAT, **content, "digest": _ZEROS.decode()}, indent=1).encode()
    head, _, end = blank.rpartition(_ZEROS)
    return head + xxh3_128_hexdigest(blank + covered(place)).encode() + end


def read(data: bytes, place: Place) -> tuple[dict[str, Any], bool]:
    """Content of a JSON file without format and digest, and whether it has a seal of the present version.

    Args:
        data: Bytes of the file.
        place: Where it belongs.

    Raises:
        ValueError: It is damaged, or not the file that was published at this place; the message states the reason.
        NewerFormat: It is intact, and of a format that this version does not know.
    """
    try:
        content = json.loads(data)
    except RecursionError as error:
        raise ValueError("its JSON is nested too deeply") from error
    if not isinstance(content, dict):
        raise ValueError("it holds no JSON object")
    version, digest = content.pop("format", 1), content.pop("digest", None)
    if digest is None and version not in (1, 2, FORMAT):
        raise NewerFormat(f"written in format {version!r}, not {FORMAT}")
    if version in (1, 2) and not place.may_be_older:
        raise ValueError("it is of another lake")
    if version == 1 and digest is None:
        return content, False
    head, found, end = data.rpartition(str(digest).encode())
    position = place.name.encode() if version == 2 else covered(place)
    if not found or digest != xxh3_128_hexdigest(head + _ZEROS + end + position):
        raise ValueError("its bytes differ from those that were written under this name in this lake")
    if version not in (2, FORMAT):
        raise NewerFormat(f"written in format {version!r}, not {FORMAT}")
    return content, version == FORMAT
