"""Read zarr 2 arrays of records in compressed chunks, as Lyft's recordings, one chunk at a time.

The storage format is version 2 (zarr-specs.readthedocs.io/en/latest/v2/v2.0.html). The ``zarr`` package cannot open
these arrays since release 3, which does not support records that contain arrays. A chunk is one file, decoded by
``numcodecs``.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.errors import CorruptSource, needing

_BLOSC_HEADER = 16
"""Header size in bytes; at 4, 8 and 12: decoded size, block size and encoded size, as little-endian uint32."""
_MAX_CHUNK = 1 << 30
"""Largest accepted chunk in bytes; Lyft's largest chunks have 3 million."""


class ChunkedTable:
    """One array of a zarr folder, read by rows.

    The most recent chunk is cached, as neighbouring scenes share it.

    Attributes:
        path: The array's folder.
        dtype: Type of a row.

    Raises:
        CorruptSource: Its metadata is missing, damaged or of another format.
        MissingDependency: numcodecs is not installed.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        described = _read_json(path / ".zarray")
        wanted = {"zarr_format": 2, "filters": None, "order": "C"}
        found = {name: described.get(name) for name in wanted}
        if found != wanted:
            raise CorruptSource(f"{path}/.zarray: expected {wanted}, found {found}; download it again")
        self.dtype = _dtype(described.get("dtype"), path)
        self._length, self._chunk = (_size(described.get(name), name, path) for name in ("shape", "chunks"))
        if not 0 < self._chunk * self.dtype.itemsize <= _MAX_CHUNK:
            raise CorruptSource(f"{path}/.zarray: expected chunks of 1 row to 1 GiB, found {self._chunk} rows")
        compressor = described.get("compressor")
        if not isinstance(compressor, dict | None):
            raise CorruptSource(f"{path}/.zarray: compressor: expected its settings by name, found {compressor!r}")
        self._is_blosc = compressor is not None and compressor.get("id") == "blosc"
        self._codec = _codec(compressor, path)
        self._kept: tuple[int, Array] | None = None

    def __len__(self) -> int:
        return self._length

    def rows(self, first: int, last: int) -> Array:
        """Read rows ``first`` to ``last - 1``, which have to exist.

        Raises:
            CorruptSource: A chunk is missing or damaged.
        """
        parts = [np.zeros(0, self.dtype)]
        for number in range(first // self._chunk, -(-last // self._chunk) if last > first else 0):
            start = number * self._chunk
            parts.append(self._read(number)[max(first - start, 0) : last - start])
        return np.concatenate(parts) if len(parts) > 2 else parts[-1]

    def chunk_files(self, first: int, last: int) -> list[Path]:
        """Files of the chunks with rows ``first`` to ``last - 1``."""
        numbers = range(first // self._chunk, -(-last // self._chunk)) if last > first else ()
        return [self.path / str(number) for number in numbers]

    def _read(self, number: int) -> Array:
        if self._kept and self._kept[0] == number:
            return self._kept[1]
        file = self.path / str(number)
        size = self._chunk * self.dtype.itemsize
        try:
            data = file.read_bytes()
        except FileNotFoundError as error:
            # zarr reads a missing chunk as zeros; Lyft's writer stores all of them.
            raise CorruptSource(f"{file}: this chunk is missing; download it again") from error
        except OSError as error:
            raise CorruptSource(f"{file}: this chunk cannot be read ({error.strerror}); download it again") from error
        if self._is_blosc and not _is_blosc(data, size):
            raise CorruptSource(f"{file}: expected a complete Blosc chunk of {size} bytes; download it again")
        try:
            decoded = bytes(self._codec.decode(data)) if self._codec else data
        except (RuntimeError, ValueError, OSError, EOFError) as error:
            raise CorruptSource(f"{file}: expected a compressed chunk, found other bytes; download it again") from error
        if len(decoded) != size:
            raise CorruptSource(f"{file}: expected {size} bytes, found {len(decoded)}; download it again")
        records = np.frombuffer(decoded, self.dtype)
        self._kept = (number, records)
        return records


def read_attributes(folder: Path) -> dict[str, Any]:
    """Read the attributes of a zarr folder.

    Raises:
        CorruptSource: Missing or damaged attributes.
    """
    return _read_json(folder / ".zattrs")


def _read_json(path: Path) -> dict[str, Any]:
    try:
        content = json.loads(path.read_bytes())
    except OSError as error:
        raise CorruptSource(f"{path}: cannot be read ({error.strerror}); download it again") from error
    except (ValueError, RecursionError) as error:
        raise CorruptSource(f"{path}: expected JSON, found other text; download it again") from error
    if not isinstance(content, dict):
        raise CorruptSource(f"{path}: expected a JSON object, found {content!r:.60}; download it again")
    return content


def _dtype(fields: Any, path: Path) -> np.dtype[Any]:
    """Parse a record type from its JSON form, with lists in place of tuples."""
    try:
        dtype = np.dtype([(name, kind, *(tuple(shape) for shape in rest)) for name, kind, *rest in fields])
    except (ValueError, TypeError, SyntaxError, OverflowError) as error:
        wanted = "expected the name, type and shape of each field of a record"
        raise CorruptSource(f"{path}/.zarray: dtype: {wanted}, found {fields!r:.200}; download it again") from error
    if dtype.hasobject or not dtype.names or not dtype.itemsize:
        raise CorruptSource(f"{path}/.zarray: dtype: expected a record of numbers and text, found {fields!r:.200}")
    return dtype


def _size(sizes: Any, name: str, path: Path) -> int:
    """The size of a one-dimensional array or chunk."""
    is_one = isinstance(sizes, list) and len(sizes) == 1 and type(sizes[0]) is int
    if not (is_one and 0 <= sizes[0] < 2**48):
        raise CorruptSource(f"{path}/.zarray: {name}: expected a list of one size, found {sizes!r:.60}")
    return int(sizes[0])


def _codec(compressor: Mapping[str, Any] | None, path: Path) -> Any:
    """Return the decoder of chunks; None if they are not compressed."""
    if compressor is None:
        return None
    with needing("Lyft's zarr chunks need numcodecs", "lyft"):
        import numcodecs
    try:
        return numcodecs.get_codec(dict(compressor))
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        wanted = "expected a compressor that numcodecs has"
        raise CorruptSource(f"{path}/.zarray: {wanted}, found {compressor!r:.200}; download it again") from error


def _is_blosc(data: bytes, size: int) -> bool:
    """Whether the header matches the size of the chunk and of the decoded array.

    Blosc trusts the header and would read beyond the end of a truncated chunk.
    """
    if len(data) < _BLOSC_HEADER:
        return False
    decoded, _, encoded = np.frombuffer(data, "<u4", count=3, offset=4).tolist()
    return bool(decoded == size and encoded == len(data))
