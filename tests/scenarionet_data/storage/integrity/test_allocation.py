"""Files of older lakes, whose bytes no digest covers, do not make readers allocate what a few bytes declare."""

import subprocess
import sys

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from scenarionet_data.errors import LakeError
from scenarionet_data.storage.files.places import open_files

NAME = "databases/made/1.parquet"
DECLARED = 825_000_000
"""Values of 4 bytes: 3.3 GB."""
_I32, _I64, _BINARY, _LIST, _STRUCT = 5, 6, 8, 9, 12


def varint(number):
    encoded = bytearray()
    while number > 127:
        encoded.append(number & 127 | 128)
        number >>= 7
    return bytes([*encoded, number])


def integer(number):
    return varint(2 * number)


_RLE = integer(3)


def text(word):
    return varint(len(word)) + word.encode()


def items(kind, *values):
    return bytes([len(values) << 4 | kind]) + b"".join(values)


def struct(**fields):
    """A struct in Thrift's compact protocol, of fields like ``i3=(type, content)``, in ascending order."""
    written, before = b"", 0
    for name, (kind, content) in fields.items():
        number = int(name[1:])
        written += bytes([number - before << 4 | kind]) + content
        before = number
    return written + b"\0"


def file_of(num_values, padding):
    """A file with one column of nulls, in a page of 31 bytes or, with padding, of a few more.

    Args:
        num_values: Number of nulls, which Arrow allocates as values of 4 bytes.
        padding: Zeros at the end of the page, which are compressed.
    """
    run = varint(2 * num_values) + b"\0"  # definition levels: one run of nulls
    content = len(run).to_bytes(4, "little") + run + bytes(padding)
    stored = pa.Codec("zstd").compress(content).to_pybytes() if padding else content
    data_page = struct(i1=(_I32, integer(num_values)), i2=(_I32, integer(0)), i3=(_I32, _RLE), i4=(_I32, _RLE))
    header = struct(
        i1=(_I32, integer(0)),
        i2=(_I32, integer(len(content))),
        i3=(_I32, integer(len(stored))),
        i5=(_STRUCT, data_page),
    )
    page, size = header + stored, len(header) + len(content)
    meta = struct(
        i1=(_I32, integer(1)),
        i2=(_LIST, items(_I32, integer(0))),
        i3=(_LIST, items(_BINARY, text("number"))),
        i4=(_I32, integer(6 if padding else 0)),  # zstd or none
        i5=(_I64, integer(num_values)),
        i6=(_I64, integer(size)),
        i7=(_I64, integer(len(page))),
        i9=(_I64, integer(4)),
    )
    group = struct(
        i1=(_LIST, items(_STRUCT, struct(i2=(_I64, integer(4)), i3=(_STRUCT, meta)))),
        i2=(_I64, integer(size)),
        i3=(_I64, integer(num_values)),
    )
    root = struct(i4=(_BINARY, text("schema")), i5=(_I32, integer(1)))
    leaf = struct(i1=(_I32, integer(1)), i3=(_I32, integer(1)), i4=(_BINARY, text("number")))
    footer = struct(
        i1=(_I32, integer(2)),
        i2=(_LIST, items(_STRUCT, root, leaf)),
        i3=(_I64, integer(num_values)),
        i4=(_LIST, items(_STRUCT, group)),
    )
    return b"PAR1" + page + footer + len(footer).to_bytes(4, "little") + b"PAR1"


def published(root, num_values, padding):
    path = root / NAME
    path.parent.mkdir(parents=True)
    path.write_bytes(file_of(num_values, padding))
    assert pq.read_metadata(path).num_rows == num_values  # Arrow believes it
    return root


def test_nulls_in_a_few_bytes_are_read(tmp_path):
    assert open_files(published(tmp_path, 200, 0)).read(NAME)["number"].null_count == 200


@pytest.mark.parametrize("padding", [0, 2**20])
def test_gigabytes_in_a_few_bytes_are_refused(tmp_path, padding):
    with pytest.raises(LakeError, match="825,000,000 rows in"):
        open_files(published(tmp_path, DECLARED, padding)).read(NAME)


PROBE = f"""
import resource, sys
from scenarionet_data.errors import LakeError
from scenarionet_data.storage.files.places import open_files
import pyarrow.parquet
files = open_files(sys.argv[1])
before = resource.getrusage(resource.RUSAGE_SELF)
try:
    files.read("{NAME}")
except LakeError:
    pass
after = resource.getrusage(resource.RUSAGE_SELF)
print(after.ru_maxrss - before.ru_maxrss, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
"""


@pytest.mark.long
@pytest.mark.parametrize(("num_values", "padding"), [(200, 0), (DECLARED, 0), (DECLARED, 2**20), (8_000_000, 2**20)])
def test_what_is_allocated_is_bounded(tmp_path, num_values, padding):
    """The last file agrees with itself: it declares as much as its 31 + 60 bytes can hold."""
    root = published(tmp_path, num_values, padding)
    done = subprocess.run([sys.executable, "-c", PROBE, str(root)], capture_output=True, text=True, check=True)
    kilobytes, seconds = map(float, done.stdout.split())
    assert kilobytes < 200_000
    assert seconds < 5
