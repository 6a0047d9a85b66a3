"""Examples on the documentation pages about object stores and other engines run."""

from __future__ import annotations

import obstore
import pytest
from obstore.store import from_url

from scenarionet_data import Lake
from tests.fixtures.examples import run_blocks
from tests.fixtures.object_store import BUCKET
from tests.fixtures.waymo import scenario_bytes, write_tfrecord

pytestmark = pytest.mark.long


def test_remote_examples_run(store, monkeypatch, tmp_path):
    path = write_tfrecord(tmp_path / "training.tfrecord-00000-of-01000", [scenario_bytes(1)])
    bucket = from_url(f"s3://{BUCKET}", client_options={"allow_http": True})
    obstore.put(bucket, f"raw/waymo/training/{path.name}", path.read_bytes())
    assert run_blocks("docs/guides/remote.md", monkeypatch, tmp_path) == 3
    assert len(Lake(f"s3://{BUCKET}/lake").database("busy")) > 5
    assert len(Lake(tmp_path / "lake")) == 1


@pytest.mark.filterwarnings("ignore:The inplace keyword")  # Dask 2026.8 with pandas 3.1
def test_engine_examples_run(monkeypatch, tmp_path):
    assert run_blocks("docs/guides/engines.md", monkeypatch, tmp_path) == 3
