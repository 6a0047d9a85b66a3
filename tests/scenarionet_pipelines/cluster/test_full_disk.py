"""Full disks under the workers of a cluster, with real schedulers, workers and commands.

Each case is a function that runs where a small disk is mounted and returns what it observed.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from scenarionet_data import Lake, convert
from scenarionet_data.storage.files.places import open_files
from tests.fixtures.lakes import content
from tests.fixtures.made import NAME, held_raw
from tests.fixtures.small_disk import filled, on_small_disk
from tests.fixtures.waiting import HANGS_AFTER
from tests.scenarionet_pipelines.cluster.conftest import Dask
from tests.scenarionet_pipelines.cluster.test_faults import report_of, start

pytestmark = pytest.mark.long

NO_SPACE = "No space left on device; free some space and run the same command again: finished shards are kept\n"
SHARD = 56_000
"""Bytes that a shard of these takes in a lake, in whole blocks."""


@contextmanager
def cluster(folder: Path) -> Iterator[Dask]:
    """A scheduler without workers."""
    dask = Dask(folder)
    try:
        dask.start_scheduler()
        yield dask
    finally:
        dask.end()


def seen_in(lake: Path | str) -> dict[str, Any]:
    """Number of finished shards in a lake, and the content visible to readers."""
    files = open_files(lake)
    finished, is_lake = files.listing("metadata"), bool(files.names("snapshots", ".json"))
    visible = len(Lake(lake)) if is_lake else 0
    return {"finished": len(finished), "visible": visible, "content": content(lake) if is_lake else []}


def convert_twice(folder: Path, disk: Path, left: int, lake: Path | str, **workers: str) -> dict[str, Any]:
    """Convert with the disk nearly full, then repeat the command after space was freed.

    Args:
        folder: Folder of recordings and logs, on a disk with space.
        disk: The small disk.
        left: Free bytes on it.
        lake: Path or URL of the lake.
        workers: Environment variables of the workers only.
    """
    raw = held_raw(folder / "raw", shards=10)
    with cluster(folder) as dask:
        with filled(disk, left):
            for _ in range(2):
                dask.start_worker("--nanny", variables=workers)
            command, log = start(dask, raw, lake, "--cluster", dask.address)
            code = command.wait(HANGS_AFTER)
            said, full = log.read_text(), seen_in(lake)
        again = report_of(*start(dask, raw, lake, "--cluster", dask.address))
        return {"code": code, "said": said, "full": full, "again": again, "end": seen_in(lake)}


def assert_nothing_is_lost_or_double(found: dict[str, Any], folder: Path) -> None:
    full, again = found["full"], found["again"]
    assert (found["code"], found["said"].count("\n")) == (1, 1)
    assert found["said"].endswith(NO_SPACE)
    assert 1 <= full["finished"] < 10
    assert full["visible"] == 3 * again["skipped"]  # what was committed; the commit itself may have failed too
    assert full["finished"] <= again["skipped"] + again["adopted"] < 10
    assert again["skipped"] + again["shards"] == 10
    assert again["failed"] == []
    convert(NAME, str(folder / "raw"), folder / "undisturbed")
    undisturbed = [list(pair) for pair in content(folder / "undisturbed")]
    assert found["end"]["content"] == undisturbed
    assert all(pair in undisturbed for pair in full["content"])


def fill_the_disk_of_the_lake(disk: str, folder: str) -> dict[str, Any]:
    return convert_twice(Path(folder), Path(disk), 5 * SHARD, Path(disk, "lake"))


def test_full_disk_of_the_lake(tmp_path):
    found = on_small_disk(tmp_path / "disk", f"{__name__}:fill_the_disk_of_the_lake", tmp_path)
    assert_nothing_is_lost_or_double(found, tmp_path)


def fill_the_disk_of_uploads(disk: str, folder: str, url: str) -> dict[str, Any]:
    return convert_twice(Path(folder), Path(disk), 2 * SHARD, url, SCENARIONET_CACHE=f"{disk}/copies")


def test_full_disk_for_uploads(tmp_path, url):
    """The object store has space, the workers' machine has none."""
    found = on_small_disk(tmp_path / "disk", f"{__name__}:fill_the_disk_of_uploads", tmp_path, url)
    assert_nothing_is_lost_or_double(found, tmp_path)
    assert f"cannot write {tmp_path / 'disk' / 'copies'}" in found["said"]


def fill_the_disk_of_dask(disk: str, folder: str) -> dict[str, Any]:
    raw = held_raw(Path(folder, "raw"), shards=3)
    with cluster(Path(folder)) as dask, filled(Path(disk), 0):
        dask.start_worker("--nanny", "--local-directory", disk, variables={"TMPDIR": disk})
        return report_of(*start(dask, raw, Path(folder, "lake"), "--cluster", dask.address))


def test_full_disk_for_dask_spill(tmp_path):
    """Nothing needs to spill: results are small, and scenarios are written directly into the lake."""
    report = on_small_disk(tmp_path / "disk", f"{__name__}:fill_the_disk_of_dask", tmp_path)
    assert (report["converted"], report["failed"]) == (9, [])
    (share,) = report["workers"].values()
    assert share["counts"] == {"scenarios": 9, "bytes": report["size"]}


def fill_the_disk_of_pickles(disk: str, folder: str) -> dict[str, Any]:
    lake, target = Path(folder, "lake"), Path(disk, "pickles")
    convert(NAME, str(held_raw(Path(folder, "raw"), shards=10)), lake)
    Lake(lake).filter("true", name="all")
    with cluster(Path(folder)) as dask:
        dask.start_worker("--nanny")
        words = ("scenarionet_pipelines.cli", "export", str(lake), "all", str(target), "--json", "--quiet")
        with filled(Path(disk), SHARD):
            command, log = dask.start(*words, "--cluster", dask.address)
            code = command.wait(HANGS_AFTER)
            left = [path.name for path in Path(disk).iterdir()]
        again = report_of(*dask.start(*words, "--cluster", dask.address))
    return {"code": code, "said": log.read_text(), "left": left, "again": again["scenarios"]}


def test_full_disk_of_an_export(tmp_path):
    found = on_small_disk(tmp_path / "disk", f"{__name__}:fill_the_disk_of_pickles", tmp_path)
    assert found["code"] == 1
    assert found["said"].startswith(f"error: cannot write {tmp_path / 'disk' / 'pickles'}: No space left on device; ")
    assert found["said"].endswith("free some space or choose another directory, and run the same command again\n")
    assert found["left"] == ["ballast"]
    assert found["again"] == 30
