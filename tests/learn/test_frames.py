"""Torch takes frames by DLPack; ``tests/cuda`` has the test with a graphics card."""

from __future__ import annotations

import numpy as np
import pytest

from tests.scenarionet_sim.cameras.test_cuda import Exporter

pytestmark = pytest.mark.learn


@pytest.mark.parametrize("dtype", [np.uint8, np.int32, np.float32])
def test_tensors_share_the_memory_of_frames(dtype):
    torch = pytest.importorskip("torch")
    exporter = Exporter(np.arange(24, dtype=dtype).reshape(1, 2, 4, 3))
    tensor = torch.from_dlpack(exporter)
    assert tensor.shape == (1, 2, 4, 3) and tensor.numpy().dtype == dtype
    tensor[0, 1, 3, 2] = 77
    assert exporter.array[0, 1, 3, 2] == 77
    expected = exporter.array.copy()
    del exporter
    np.testing.assert_array_equal(tensor.numpy(), expected)
