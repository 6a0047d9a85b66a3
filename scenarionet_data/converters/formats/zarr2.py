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
from scenarionet_data.errors import CorruptSource, MissingDependency

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
        try:
            described = json.loads((path / ".zarray").read_bytes())
            self.dtype = _dtype(described["dtype"])
            (self._length,), (self._chunk,) = map(_sizes, (described["shape"], described["chunks"]))
            wanted = {"zarr_format": 2, "filters": None, "order": "C"}
            found = {name: described[name] for name in wanted}
            compressor = described["compressor"]
        except (OSError, ValueError, TypeError, KeyError) as error:
            wanted_text = "expected the metadata of a one-dimensional zarr array"
            raise CorruptSource(f"{path}/.zarray: {wanted_text}, found {error!r}; download it again") from error
        if found != wanted or not 0 < self._chunk * self.dtype.itemsize <= _MAX_CHUNK:
            raise CorruptSource(f"{path}/.zarray: expected {wanted} and chunks up to 1 GiB, found {found}")
        self._is_blosc = bool(compressor) and compressor.get("id") == "blosc"
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
        records = self._decode(self.path / str(number))
        self._kept = (number, records)
        return records

    def _decode(self, file: Path) -> Array:
        """Read one chunk. All have the same length; rows after the array's end are not used."""
        size = self._chunk * self.dtype.itemsize
        try:
            data = file.read_bytes()
        except FileNotFoundError as error:
            # zarr reads a missing chunk as zeros; Lyft's writer stores all of them.
            raise CorruptSource(f"{file}: this chunk is missing; download it again") from error
        if self._is_blosc and not _is_blosc(data, size):
            raise CorruptSource(f"{file}: expected a complete Blosc chunk of {size} bytes; download it again")
        try:
            decoded = bytes(self._codec.decode(data)) if self._codec else data
        except (RuntimeError, ValueError) as error:
            raise CorruptSource(f"{file}: cannot be decoded ({error}); download it again") from error
        if len(decoded) != size:
            raise CorruptSource(f"{file}: expected {size} bytes, found {len(decoded)}; download it again")
        return np.frombuffer(decoded, self.dtype)


def read_attributes(folder: Path) -> dict[str, Any]:
    """Read the attributes of a zarr folder.

    Raises:
        CorruptSource: Missing or damaged attributes.
    """
    try:
        attributes = json.loads((folder / ".zattrs").read_bytes())
    except (OSError, ValueError) as error:
        raise CorruptSource(f"{folder}/.zattrs: cannot be read ({error}); download it again") from error
    if not isinstance(attributes, dict):
        raise CorruptSource(f"{folder}/.zattrs: expected attributes by name, found {type(attributes).__name__}")
    return attributes


def _dtype(fields: Any) -> np.dtype[Any]:
    """Parse a record type from its JSON form, with lists in place of tuples."""
    if not isinstance(fields, list):
        raise ValueError(f"expected the fields of a record, found {fields!r}")
    dtype = np.dtype([(name, kind, *(tuple(shape) for shape in rest)) for name, kind, *rest in fields])
    if dtype.hasobject:
        raise ValueError("a record that contains Python objects")
    return dtype


def _sizes(sizes: Any) -> list[int]:
    if not all(isinstance(size, int) and size >= 0 for size in sizes):
        raise ValueError(f"expected sizes, found {sizes!r}")
    return list(sizes)


def _codec(compressor: Mapping[str, Any] | None, path: Path) -> Any:
    """Return the decoder of chunks; None if they are not compressed."""
    if compressor is None:
        return None
    try:
        import numcodecs
    except ImportError as error:
        raise MissingDependency("Lyft's zarr chunks need numcodecs", "lyft") from error
    try:
        return numcodecs.get_codec(dict(compressor))
    except (ValueError, TypeError) as error:
        raise CorruptSource(f"{path}/.zarray: no decoder for {compressor}: {error}") from error


def _is_blosc(data: bytes, size: int) -> bool:
    """Whether the header matches the size of the chunk and of the decoded array.

    Blosc trusts the header and would read beyond the end of a truncated chunk.
    """
    if len(data) < _BLOSC_HEADER:
        return False
    decoded, _, encoded = np.frombuffer(data, "<u4", count=3, offset=4).tolist()
    return bool(decoded == size and encoded == len(data))
