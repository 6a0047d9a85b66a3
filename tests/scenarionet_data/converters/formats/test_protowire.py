"""The columnar protobuf reader on hand-made bytes: encodings, repeated fields, damage."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarionet_data.converters.formats.protowire import (
    DamagedMessage,
    Messages,
    doubles,
    enums,
    floats,
    int32s,
    int64s,
)
from tests.fixtures.waymo import field, numbers, varint

INT64 = st.integers(-(1 << 63), (1 << 63) - 1)


@given(INT64)
def test_any_integer_is_decoded(value):
    message = Messages.of(field(1, value))
    assert int64s(message.scalars("v")).tolist() == [[value]]
    wrapped = value + (1 << 31) & 0xFFFFFFFF
    assert int32s(message.scalars("v")).tolist() == [[wrapped - (1 << 31)]]


@given(st.floats(allow_nan=False), st.floats(width=32, allow_nan=False))
def test_any_float_is_decoded(double, single):
    bits = Messages.of(field(1, double) + field(2, np.float32(single))).scalars("df")
    assert doubles(bits[:, 0]).tolist() == [double]
    assert floats(bits[:, 1]).tolist() == [single]


def test_missing_fields_and_last_value_wins():
    message = Messages.of(field(2, 5) + field(2, 7))
    assert int64s(message.scalars("vvv", missing=-1)).tolist() == [[-1, 7, -1]]
    assert message.fields().column(2, "v", 1).tolist() == [7]
    assert message.fields().column(3, "v", 1).tolist() == [0]


def test_fields_of_another_type_or_number_are_skipped():
    others = field(1, 2.5) + field(1, b"text") + field(1, np.float32(1)) + field(77, 3) + field(5000, b"long")
    assert Messages.of(others + field(2, 9)).scalars("vv").tolist() == [[0, 9]]


def test_unknown_enum_values_are_replaced():
    bits = np.array([0, 2, 3, (1 << 64) - 1, 1 << 32], dtype=np.uint64)
    assert enums(bits, 3).tolist() == [0, 2, 0, 0, 0]


@given(st.lists(st.lists(INT64, max_size=4), max_size=4), st.booleans())
def test_packed_and_unpacked_lists(lists, packed):
    data = b"".join(field(1, numbers(9, values, packed)) for values in lists)
    owner, bits = Messages.of(data).fields().parts(1).fields().lists(9, "v")
    assert int64s(bits).tolist() == [value for values in lists for value in values]
    assert owner.tolist() == [row for row, values in enumerate(lists) for _ in values]


@pytest.mark.parametrize("packed", [False, True])
def test_lists_of_doubles(packed):
    fields = Messages.of(numbers(1, [0.5, -2.0], packed) + numbers(1, [7.25], not packed)).fields()
    assert doubles(fields.lists(1, "d")[1]).tolist() == [0.5, -2.0, 7.25]
    assert fields.lists(2, "d")[1].tolist() == []


def test_submessages_keep_order_and_owner():
    tree = b"".join(field(3, field(1, i) + field(2, b"x" * i)) for i in range(5)) + field(4, b"other")
    children = Messages.of(tree).fields().parts(3)
    assert children.scalars("v")[:, 0].tolist() == [0, 1, 2, 3, 4]
    assert children.fields().parts(2).contents() == [b"x" * i for i in range(5)]
    assert children[np.array([4, 1])].scalars("v")[:, 0].tolist() == [4, 1]


def test_buffers_grow_for_many_small_fields():
    """More fields than the reader initially allocates space for."""
    data = field(1, 1) * 30_000
    assert len(Messages.of(data).fields().number) == 30_000


def test_empty_message():
    message = Messages.of(b"")
    assert message.scalars("vd").tolist() == [[0, 0]]
    assert len(message.fields().number) == 0
    assert len(message.fields().parts(1).fields().parts(2)) == 0


@pytest.mark.parametrize(
    "data",
    [
        b"\x08",  # a tag without its value
        b"\x80",  # half a tag
        b"\x08" + b"\xff" * 9 + b"\x02",  # 65 bits
        b"\x08" + b"\xff" * 10 + b"\x01",  # eleven bytes
        b"\x00\x01",  # field number 0
        varint(1 << 32) + b"\x01",  # field number beyond 29 bits
        b"\x09" + bytes(7),  # a double of seven bytes
        b"\x0d" + bytes(3),  # a float of three bytes
        b"\x0a\x05abcd",  # a string longer than the message
        b"\x0a" + varint((1 << 63) - 1),  # a length near the largest integer
        b"\x0a" + varint(-1),  # a negative length
        b"\x0b\x0c",  # a group
        b"\x0e",  # wire type 6
        b"\x0f",  # wire type 7
    ],
)
def test_damaged_message_is_refused(data):
    whole = field(2, b"fine") + data
    for message in (Messages.of(data), Messages.of(field(3, data)).fields().parts(3)):
        with pytest.raises(DamagedMessage, match=f"at byte {message.first[0]}"):
            message.fields()
        with pytest.raises(DamagedMessage):
            message.scalars("vvv")
    with pytest.raises(DamagedMessage, match="at byte 0"):
        Messages.of(whole).fields()


@pytest.mark.parametrize(("content", "kind"), [(b"\x01\x80", "v"), (bytes(12), "d")])
def test_damaged_list_is_refused(content, kind):
    with pytest.raises(DamagedMessage, match="at byte 2"):
        Messages.of(field(1, content)).fields().lists(1, kind)


def test_longest_varint_at_end_of_buffer():
    """The longest possible varint, and a message that ends with the buffer."""
    assert Messages.of(b"\x08" + b"\xff" * 9 + b"\x01").scalars("v").tolist() == [[(1 << 64) - 1]]


@given(st.binary(max_size=64))
def test_arbitrary_bytes_are_decoded_or_refused(data):
    """The fields of a decoded message cover it exactly."""
    try:
        fields = Messages.of(data).fields()
    except DamagedMessage:
        return
    assert (fields.first <= fields.end).all()
    assert (fields.end[:-1] < fields.end[1:]).all()
    assert not len(fields.end) or fields.end[-1] == len(data)
    for number in set(fields.number.tolist()):
        for kind in "vd":
            try:
                owner, bits = fields.lists(number, kind)
            except DamagedMessage:
                continue
            assert len(owner) == len(bits) <= len(data)
