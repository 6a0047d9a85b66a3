"""TFRecord framing: checksums, streaming, and errors for damaged files."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarionet_data.converters.formats.tfrecord import TfRecord, masked_crc, read_records
from scenarionet_data.errors import CorruptSource
from tests.fixtures.waymo import frame, write_tfrecord

PAYLOADS = [b"first", b"", bytes(range(256)) * 40]


def bitwise_crc32c(data: bytes) -> int:
    """CRC-32C by its definition: polynomial division, bit by bit."""
    crc = 0xFFFFFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0x82F63B78 if crc & 1 else 0)
    return crc ^ 0xFFFFFFFF


@given(st.binary(max_size=200))
def test_masked_checksum_matches_bitwise_crc32c(data):
    crc = bitwise_crc32c(data)
    assert masked_crc(data) == (((crc >> 15) | (crc << 17)) + 0xA282EAD8) % 2**32


def test_records_of_a_file(tmp_path):
    path = write_tfrecord(tmp_path / "a.tfrecord", PAYLOADS)
    offsets = [0, 16 + len(PAYLOADS[0]), 32 + len(PAYLOADS[0])]
    assert list(read_records(path)) == [TfRecord(o, p) for o, p in zip(offsets, PAYLOADS, strict=True)]


def test_checksums_of_recorded_file(recordings):
    (record,) = read_records(recordings / "waymo/training/motion_data_one_scenario.tfrecord")
    assert record.damage is None
    assert len(record.payload) == 952_947


def test_records_are_read_lazily(tmp_path):
    """Bytes after a record are not read before the next record is requested."""
    path = write_tfrecord(tmp_path / "a.tfrecord", PAYLOADS)
    path.write_bytes(path.read_bytes() + b"damage beyond the last record")
    records = read_records(path)
    assert [next(records).payload for _ in PAYLOADS] == PAYLOADS
    assert "damaged record length" in str(next(records).damage)
    assert list(records) == []


def test_damaged_payload_is_marked_and_the_next_is_read(tmp_path):
    path = write_tfrecord(tmp_path / "a.tfrecord", PAYLOADS)
    data = bytearray(path.read_bytes())
    data[12] ^= 1
    path.write_bytes(data)
    assert [record.damage for record in read_records(path)] == ["wrong checksum", None, None]


@pytest.mark.parametrize(
    ("keep", "message"),
    [
        (0, "empty file"),
        (5, "truncated inside the record header at byte 0"),
        (20, "record at byte 0 should end at byte 21, the file ends at byte 20"),
    ],
)
def test_truncated_file_error_has_a_position(tmp_path: Path, keep: int, message: str):
    path = tmp_path / "a.tfrecord"
    path.write_bytes((frame(PAYLOADS[0]) + frame(PAYLOADS[1]))[:keep])
    with pytest.raises(CorruptSource, match=message) as caught:
        list(read_records(path))
    assert str(path) in str(caught.value)
    assert "download it again" in str(caught.value)


@pytest.mark.parametrize(
    ("keep", "message"),
    [
        (25, "truncated inside the record header at byte 21"),
        (36, "truncated: the record at byte 21 should end at byte 37, the file ends at byte 36"),
    ],
)
def test_records_before_a_truncation_are_whole(tmp_path: Path, keep: int, message: str):
    path = tmp_path / "a.tfrecord"
    path.write_bytes((frame(PAYLOADS[0]) + frame(PAYLOADS[1]))[:keep])
    assert list(read_records(path)) == [TfRecord(0, PAYLOADS[0]), TfRecord(21, b"", message)]


def test_other_format_is_named(tmp_path):
    path = tmp_path / "a.tfrecord"
    path.write_bytes(b"PAR1" + bytes(100))
    with pytest.raises(CorruptSource, match="not a TFRecord file"):
        list(read_records(path))


def test_length_beyond_the_file_is_not_allocated(tmp_path):
    """A length with a valid checksum that exceeds the file size."""
    length = struct.pack("<Q", 1 << 60)
    path = tmp_path / "a.tfrecord"
    path.write_bytes(length + struct.pack("<I", masked_crc(length)) + b"x")
    with pytest.raises(CorruptSource, match="truncated: the record at byte 0"):
        list(read_records(path))
