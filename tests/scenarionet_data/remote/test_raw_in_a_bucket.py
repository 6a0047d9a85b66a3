"""Raw recordings in an object store become the lake that the same recordings in a folder become."""

from __future__ import annotations

import tempfile
from pathlib import Path

import obstore
import pytest
from obstore.store import from_url

from scenarionet_data import Lake, ScenarioLoader, convert
from scenarionet_data.conversion import driver
from scenarionet_data.errors import BadParameter, DuplicateScenario, SourceNotFound
from scenarionet_data.testing import differences
from tests.fixtures import argoverse2, waymo
from tests.fixtures.made import NAME, MadeOptions, write_raw
from tests.fixtures.object_store import BUCKET

pytestmark = pytest.mark.long

FEW = MadeOptions(num_objects=2)


@pytest.fixture
def bucket(store):
    return from_url(f"s3://{BUCKET}", client_options={"allow_http": True})


def upload(bucket, folder, prefix):
    """A folder's files below a prefix; returns its URL."""
    for path in Path(folder).rglob("*"):
        if path.is_file():
            obstore.put(bucket, f"{prefix}/{path.relative_to(folder).as_posix()}", path.read_bytes())
    return f"s3://{BUCKET}/{prefix}"


def same(one, other):
    one, other = ScenarioLoader(one), ScenarioLoader(other)
    assert len(one) == len(other) > 0
    return [differences(a, b) for a, b in zip(one, other, strict=True)] == [[]] * len(one)


def leftovers():
    return set(Path(tempfile.gettempdir()).glob("scenarionet-*"))


@pytest.mark.parametrize("workers", [1, 2])
def test_a_folder_and_a_bucket_make_the_same_lake(url, bucket, tmp_path, workers):
    raw = write_raw(tmp_path / "raw" / "validation", {f"s{k}": [k * 10, k * 10 + 1] for k in range(3)})
    before = leftovers()
    report = convert(NAME, upload(bucket, raw, f"{url[-41:]}/validation"), url, options=FEW, workers=workers)
    assert (report.converted, report.failed, report.partitions) == (6, [], {("made", "v1", "val")})
    assert leftovers() <= before
    convert(NAME, str(raw), tmp_path / "lake", options=FEW)
    assert same(url, tmp_path / "lake")


def test_what_is_converted_is_skipped_and_what_has_changed_is_seen(url, bucket, tmp_path):
    raw = write_raw(tmp_path / "raw", {"s0": [1], "s1": [2]})
    place = upload(bucket, raw, "changing")
    assert convert(NAME, place, tmp_path / "lake", options=FEW).converted == 2
    write_raw(tmp_path / "more", {"s2": [3]})
    upload(bucket, tmp_path / "more", "changing")
    report = convert(NAME, place, tmp_path / "lake", options=FEW)
    assert (report.skipped, report.converted) == (2, 1)
    obstore.put(bucket, "changing/s1.made", b"7")  # as long as it was
    with pytest.raises(DuplicateScenario, match="has changed since"):
        driver.plan_conversion(NAME, place, tmp_path / "lake", options=FEW)
    assert convert(NAME, place, tmp_path / "lake", options=FEW, replace_old=True).replaced == 1
    assert len(Lake(tmp_path / "lake")) == 3


def test_waymo_files_and_one_of_them(bucket, tmp_path):
    raw = tmp_path / "training"
    raw.mkdir()
    for number in range(2):
        waymo.write_tfrecord(raw / f"training.tfrecord-0000{number}-of-00002", [waymo.scenario_bytes(number)])
    place = upload(bucket, raw, "waymo/training")
    convert("waymo", place, tmp_path / "remote")
    convert("waymo", str(raw), tmp_path / "local")
    assert same(tmp_path / "remote", tmp_path / "local")
    convert("waymo", f"{place}/training.tfrecord-00001-of-00002", tmp_path / "one")
    assert len(Lake(tmp_path / "one")) == 1


def test_folders_of_scenarios(bucket, tmp_path):
    raw = tmp_path / "train"
    argoverse2.write_forecasting(raw, num_scenarios=2, num_tracks=12, num_timesteps=60)
    convert("argoverse2", upload(bucket, raw, "av2/train"), tmp_path / "remote")
    convert("argoverse2", str(raw), tmp_path / "local")
    assert same(tmp_path / "remote", tmp_path / "local")


def test_what_cannot_be(bucket, tmp_path):
    with pytest.raises(SourceNotFound, match="nothing there"):
        convert(NAME, f"s3://{BUCKET}/nowhere", tmp_path / "lake")
    with pytest.raises(BadParameter, match="copy them to a folder first"):
        convert("nuscenes", f"s3://{BUCKET}/nowhere", tmp_path / "lake")
