"""The format of tensors equals that of the package safetensors."""

from __future__ import annotations

import numpy as np
import pytest

from scenarionet_sim.drivers.checkpoints import decode, encode

ARRAYS = {
    "weights": np.arange(6, dtype=np.float32).reshape(2, 3),
    "steps": np.float32(3.0),
    "state": np.arange(5, dtype=np.uint8),
    "none": np.zeros((0, 4)),
    "flags": np.array([True, False]),
}


def test_arrays_are_read_back():
    found = decode(encode(ARRAYS))
    assert found.keys() == ARRAYS.keys()
    for name, values in ARRAYS.items():
        np.testing.assert_array_equal(found[name], values)
        assert found[name].dtype == np.asarray(values).dtype and found[name].shape == np.shape(values)


def test_the_package_reads_and_writes_the_same():
    safetensors = pytest.importorskip("safetensors.numpy")
    for name, values in safetensors.load(encode(ARRAYS)).items():
        np.testing.assert_array_equal(values, ARRAYS[name])
    arrays = {name: np.asarray(values) for name, values in ARRAYS.items()}
    for name, values in decode(safetensors.save(arrays)).items():
        np.testing.assert_array_equal(values, ARRAYS[name])
