"""Cluster workers convert recordings in a bucket: each fetches shared files once and leaves no files behind."""

from __future__ import annotations

import signal

import pytest

from scenarionet_data import convert, converters
from scenarionet_pipelines.cluster import open_cluster
from tests.fixtures import nuplan, nuplan_drive
from tests.fixtures.buckets import fetched, same, upload
from tests.fixtures.waiting import until

pytestmark = pytest.mark.long


@pytest.mark.parametrize("end", [signal.SIGTERM, signal.SIGKILL])
def test_worker_fetches_files_shared_by_its_shards_once(store, dask, tmp_path, monkeypatch, end):
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setenv("TMPDIR", str(temporary))
    raw = nuplan.write_raw(tmp_path / "raw", [nuplan_drive.invented(seed, seconds=4.0) for seed in range(4)])
    place = upload(raw, f"cluster/{end.name}")
    worker = dask.start_worker()
    store.set()
    how = {"split": "mini", "options": converters.get("nuplan").Options(past=0.5)}
    with open_cluster(dask.address) as executor:
        remote = convert("nuplan", place, tmp_path / "remote", executor=executor, **how)
    shared = {path: times for path, times in fetched(store, f"cluster/{end.name}").items() if "splits" not in path}
    assert shared == {  # by the client for the listing and the shared map, then by the worker
        "maps/nuplan-maps-v1.0.json": 2,
        f"maps/{nuplan.LOCATION}/{nuplan.VERSION}/map.gpkg": 2,
    }
    assert remote.converted == convert("nuplan", str(raw), tmp_path / "local", **how).converted > 0
    assert same(tmp_path / "remote", tmp_path / "local")
    (kept,) = temporary.glob("scenarionet-raw-*")
    assert len(list(kept.rglob("*.db"))) == 1
    worker.send_signal(end)
    worker.wait()
    if end is signal.SIGKILL:
        dask.start_worker()
        with open_cluster(dask.address) as executor:
            convert("nuplan", place, tmp_path / "again", executor=executor, **how)
        assert not kept.exists()
    else:
        until(lambda: not kept.exists(), "the worker has removed its folder")
