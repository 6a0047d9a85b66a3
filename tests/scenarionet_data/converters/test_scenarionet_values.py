"""Values of pickles are represented in JSON without loss."""

from __future__ import annotations

import json
from collections import defaultdict
from typing import Any

import numpy as np
import pytest

from scenarionet_data.converters.scenarionet.columns import literal, pack, unpack, value_of
from scenarionet_data.converters.scenarionet.values import from_plain, to_plain

VALUES: list[Any] = [
    None, True, 0, 2.5, "text", [1, [2.0]], {"a": {"b": 1}}, (1, (2,)), {1, 2}, frozenset({"x"}), b"bytes",
    {1: "int", "!": "kind"}, {"!": "array"}, float("inf"), float("-inf"), defaultdict(int, {"VEHICLE": 2}),
]  # fmt: skip
ARRAYS = [
    np.zeros((3, 2), np.float32), np.arange(6.0).reshape(2, 3), np.array([True, False]), np.zeros((0, 3)),
    np.array(2.5),
    np.array(["a", None], object), np.array(["ab", "c"]), np.arange(3, dtype=">i4"), np.array([np.nan, np.inf]),
]  # fmt: skip


@pytest.mark.parametrize("value", VALUES, ids=repr)
def test_values_come_back(value: Any) -> None:
    again = from_plain(json.loads(json.dumps(to_plain(value), allow_nan=False)))
    assert again == value and type(again) is type(value)
    assert value_of(literal(value)) == value


@pytest.mark.parametrize("array", ARRAYS, ids=repr)
def test_arrays_come_back_writable(array: np.ndarray[Any, Any]) -> None:
    again = from_plain(json.loads(json.dumps(to_plain(array), allow_nan=False)))
    assert (again.dtype, again.shape, again.flags.writeable) == (array.dtype, array.shape, True)
    assert again.tolist() == array.tolist() or np.array_equal(again, array, equal_nan=True)


def test_numpy_scalars_become_numbers() -> None:
    assert to_plain([np.float32(0.5), np.bool_(True), np.int64(3)]) == [0.5, True, 3]
    with pytest.raises(TypeError, match="found complex"):
        to_plain(np.complex64(1))


@pytest.mark.parametrize("forms", [["a"], ["a", "a"], ["a", None, "b", "a"], [None, "a"], []])
def test_columns_unpack_to_the_same_forms(forms: list[str | None]) -> None:
    assert unpack(json.loads(json.dumps(pack(forms))), len(forms)) == forms
