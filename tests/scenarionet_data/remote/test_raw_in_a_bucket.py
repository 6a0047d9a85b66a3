"""Raw recordings in an object store are listed, watched, selected and refused like those in a folder."""

from __future__ import annotations

import os
import tempfile
from functools import partial

import pytest

from scenarionet_data import Lake, convert
from scenarionet_data.conversion import InputSelection, driver, watch
from scenarionet_data.converters.argoverse1 import Argoverse1Options
from scenarionet_data.converters.nuplan import NuPlanOptions
from scenarionet_data.errors import BadParameter, DuplicateScenario, SourceNotFound
from scenarionet_data.storage.files.object_store import ObjectStore
from tests.fixtures import argoverse1, lyft, nuplan, nuplan_drive, nuscenes, scenarionet_pickles, waymo
from tests.fixtures.buckets import fetched, put, same, upload
from tests.fixtures.made import NAME, NEWER, MadeOptions, write_raw
from tests.fixtures.object_store import BUCKET

pytestmark = pytest.mark.long

FEW = MadeOptions(num_objects=2)


@pytest.fixture
def temporary(tmp_path, monkeypatch):
    """A private folder for temporary files of this process and its workers."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setenv("TMPDIR", str(folder))
    monkeypatch.setattr(tempfile, "tempdir", None)
    return folder


@pytest.mark.parametrize("workers", [1, 2])
def test_folder_and_bucket_give_the_same_lake(url, tmp_path, temporary, workers):
    raw = write_raw(tmp_path / "raw" / "validation", {f"s{k}": [k * 10, k * 10 + 1] for k in range(3)})
    report = convert(NAME, upload(raw, f"{url[-41:]}/validation"), url, options=FEW, workers=workers)
    assert (report.converted, report.failed, report.partitions) == (6, [], {("made", "v1", "val")})
    assert list(temporary.glob("scenarionet-*")) == []
    convert(NAME, str(raw), tmp_path / "lake", options=FEW)
    assert same(url, tmp_path / "lake")


def test_converted_files_are_skipped_and_changes_detected(store, tmp_path):
    raw = write_raw(tmp_path / "raw", {"s0": [1], "s1": [2]})
    place = upload(raw, "changing")
    assert convert(NAME, place, tmp_path / "lake", options=FEW).converted == 2
    upload(write_raw(tmp_path / "more", {"s2": [3]}), "changing")
    report = convert(NAME, place, tmp_path / "lake", options=FEW)
    assert (report.skipped, report.converted) == (2, 1)
    put({"s1.made": b"7"}, "changing")  # same length as before
    with pytest.raises(DuplicateScenario, match="has changed since"):
        driver.plan_conversion(NAME, place, tmp_path / "lake", options=FEW)
    assert convert(NAME, place, tmp_path / "lake", options=FEW, replace=True).replaced == 1
    assert len(Lake(tmp_path / "lake")) == 3


def test_newer_converter_makes_shards_stale(store, tmp_path):
    place = upload(write_raw(tmp_path / "raw", {"s0": [1], "s1": [2]}), "stale")
    convert(NAME, place, tmp_path / "lake", options=FEW)
    assert convert(NEWER, place, tmp_path / "lake", options=FEW).stale == 2
    assert convert(NEWER, place, tmp_path / "lake", options=FEW, reconvert_stale=True).replaced == 2


def test_changed_map_is_detected(store, tmp_path):
    nuscenes.write_invented(tmp_path / "raw", num_scenes=1, num_keyframes=16)
    place = upload(tmp_path / "raw", "changing-map")
    convert("nuscenes", place, tmp_path / "lake", split="mini")
    (changed,) = (tmp_path / "raw" / "maps" / "expansion").iterdir()
    put({f"maps/expansion/{changed.name}": changed.read_bytes() + b"\n"}, "changing-map")
    with pytest.raises(DuplicateScenario, match="has changed since"):
        convert("nuscenes", place, tmp_path / "lake", split="mini")


def test_waymo_files_and_a_single_file(store, tmp_path):
    raw = tmp_path / "training"
    raw.mkdir()
    for number in range(2):
        waymo.write_tfrecord(raw / f"training.tfrecord-0000{number}-of-00002", [waymo.scenario_bytes(number)])
    place = upload(raw, "waymo/training")
    convert("waymo", place, tmp_path / "remote")
    convert("waymo", str(raw), tmp_path / "local")
    assert same(tmp_path / "remote", tmp_path / "local")
    convert("waymo", f"{place}/training.tfrecord-00001-of-00002", tmp_path / "one")
    assert len(Lake(tmp_path / "one")) == 1


def test_a_database_of_pickles_and_its_mapping(store, tmp_path):
    scenarionet_pickles.write_vintages(tmp_path / "raw")
    convert("scenarionet", upload(tmp_path / "raw", "pickles"), tmp_path / "remote", split="train")
    convert("scenarionet", str(tmp_path / "raw"), tmp_path / "local", split="train")
    assert same(tmp_path / "remote", tmp_path / "local")


def test_new_files_are_converted_once_unchanged(store, tmp_path):
    raw = write_raw(tmp_path / "raw", {"s0": [1, 2]})
    events = iter([lambda: put({"s1.made": b"3"}, "growing"), lambda: None, lambda: None])
    converting = partial(convert, NAME, upload(raw, "growing"), tmp_path / "lake", options=FEW)
    reports = watch(converting, wait=lambda _: next(events)())
    assert next(reports).converted == 2
    assert next(reports).converted == 1


def test_largest_files_come_first(store, tmp_path):
    raw = write_raw(tmp_path / "raw", {"a": range(50), "b": range(150), "c": range(100)})
    seen = []

    def run(jobs, do, lost=None):
        seen.extend(job.shard.name for job in jobs)
        return iter(())

    convert(NAME, upload(raw, "sizes"), tmp_path / "lake", options=FEW, executor=run)
    assert seen == ["b", "c", "a"]


def test_selection_by_properties(store, tmp_path):
    nuscenes.write_invented(tmp_path / "nuscenes", num_scenes=2, num_keyframes=16)
    nuplan.write_raw(tmp_path / "nuplan", [nuplan_drive.invented(seconds=4.0)])
    scenes, logs = (upload(tmp_path / name, f"chosen/{name}") for name in ("nuscenes", "nuplan"))
    boston = InputSelection({"location": "boston-*"})
    assert convert("nuscenes", scenes, tmp_path / "lake", split="mini", selection=boston).converted == 1
    for key in ("location", "tag"):
        with pytest.raises(
            BadParameter, match=f"unknown property '{key}': inputs can be selected by .* copy them first"
        ):
            convert("nuplan", logs, tmp_path / "lake", split="mini", selection=InputSelection({key: "*"}))
    named = InputSelection({"log": nuplan_drive.invented(seconds=4.0).name})
    assert len(driver.plan_conversion("nuplan", logs, tmp_path / "lake", split="mini", selection=named).shards) == 1


def test_thousands_of_images_are_not_listed(store):
    put({f"log/sensors/camera/{k:05d}.jpg": b"" for k in range(2100)}, "images/train")
    put(
        {f"log/{name}": b"x" for name in ("annotations.feather", "sensors-of-others/1", "z/sensors/1", "z/z")}, "images"
    )
    store.set()
    names = [each.name for each in ObjectStore(f"s3://{BUCKET}/images").walk(ignored={"sensors"})]
    assert names == ["log/annotations.feather", "log/sensors-of-others/1", "log/z/z"]
    assert len(store.requests()) == 2
    assert sum(1 for _ in ObjectStore(f"s3://{BUCKET}/images").walk()) == 2104


def test_temporary_folder_does_not_determine_the_split(store, tmp_path, monkeypatch):
    (tmp_path / "test").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "test"))
    place = upload(write_raw(tmp_path / "raw", {"s0": [1]}), "unsplit")
    assert convert(NAME, place, tmp_path / "lake", options=FEW).partitions == {("made", "v1", "train")}


def test_empty_folder_marker_objects_are_ignored(store, tmp_path):
    raw = write_raw(tmp_path / "raw" / "deep", {"s0": [1]}).parent
    write_raw(raw / "deep-er", {"s1": [2]})
    place = upload(raw, "marked")
    with_slash = ObjectStore(f"s3://{BUCKET}")
    with_slash.put("marked/deep", b"")  # as clients see the key "marked/deep/"
    with_slash.put("marked", b"")
    assert convert(NAME, place, tmp_path / "lake", options=FEW).converted == 2


def damaged_map(root):
    """An unreadable map, one of two; one of the tables is intact."""
    nuscenes.write_invented(root, num_scenes=2, num_keyframes=16)
    (root / "maps" / "expansion" / "boston-seaport.json").write_text("{")


def damaged_tables(root):
    nuscenes.write_invented(root, num_scenes=2, num_keyframes=16)
    table = root / "v1.0-mini" / "sample_annotation.json"
    table.write_bytes(table.read_bytes()[:-100])


def damaged_logs(root):
    """One truncated, one empty, one intact."""
    nuplan.write_raw(root, [nuplan_drive.invented(seed, seconds=4.0) for seed in range(3)])
    first, second, _ = sorted((root / "splits" / "mini").iterdir())
    os.truncate(first, 30_000)
    os.truncate(second, 0)


def lost_map(root):
    nuplan.write_raw(root, [nuplan_drive.invented(seconds=4.0)])
    next((root / "maps").rglob("map.gpkg")).unlink()


def damaged_files(root):
    argoverse1.write_recordings(root / "data", 3)
    argoverse1.write_map(root)
    (root / "data" / "2.csv").write_text("TIMESTAMP,TRACK_ID\n1,2\n")


def damaged_chunks(root):
    lyft.write_dataset(root, num_scenes=3, num_frames=30)
    chunks = root / "scenes" / "sample.zarr" / "agents"
    (chunks / "0").write_bytes(b"nothing")
    (chunks / "3").unlink()


DAMAGE = {
    "a map": ("nuscenes", damaged_map),
    "tables": ("nuscenes", damaged_tables),
    "logs": ("nuplan", damaged_logs),
    "no map": ("nuplan", lost_map),
    "files": ("argoverse1", damaged_files),
    "chunks": ("lyft", damaged_chunks),
}


@pytest.mark.parametrize("case", DAMAGE)
def test_damage_fails_as_in_a_folder(store, tmp_path, case):
    name, write = DAMAGE[case]
    raw, split = tmp_path / "raw", "mini" if name in ("nuscenes", "nuplan") else "train"
    raw.mkdir()
    write(raw)
    place = upload(raw, f"damaged/{case.replace(' ', '-')}")
    told = {}
    for root, lake in ((str(raw), tmp_path / "local"), (place, tmp_path / "remote")):
        report = convert(name, root, lake, split=split)
        assert report.failed or report.quarantined
        query = "SELECT scenario_id, field, message FROM quarantine ORDER BY ALL"
        refused = Lake(lake).sql(query).rows() if report.shards else []
        told[root] = repr((report.converted, sorted(report.failed), refused))
    assert told[place] == told[str(raw)].replace(str(raw), place)


def test_invalid_urls_are_refused(store, tmp_path):
    with pytest.raises(SourceNotFound, match="nothing there"):
        convert(NAME, f"s3://{BUCKET}/nowhere", tmp_path / "lake")
    place = put({"some/thing.txt": b"x"}, "strange")
    with pytest.raises(SourceNotFound, match=r"s3://bucket/strange: no folder with scene.json"):
        convert("nuscenes", place, tmp_path / "lake")
    for name, options in (("nuplan", NuPlanOptions(maps=place)), ("argoverse1", Argoverse1Options(maps=place))):
        with pytest.raises(BadParameter, match="option 'maps': s3://bucket/strange is not a folder on this machine"):
            convert(name, str(tmp_path), tmp_path / "lake", options=options)
    assert fetched(store, "strange") == {}
