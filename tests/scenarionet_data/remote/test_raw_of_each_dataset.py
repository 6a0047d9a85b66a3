"""Each dataset in a bucket: the lake equals that of a folder, and nothing is fetched twice or needlessly."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from scenarionet_data import convert, converters
from scenarionet_data.conversion import InputSelection
from scenarionet_data.converters import lyft as lyft_converter
from scenarionet_data.converters import nuscenes as nuscenes_converter
from tests.fixtures import argoverse1, argoverse2, lyft, nuplan, nuplan_drive, nuscenes
from tests.fixtures.buckets import fetched, put, same, upload

pytestmark = pytest.mark.integration

DRIVES = [nuplan_drive.invented(seed, seconds=4.0) for seed in range(3)]
BOSTON = "us-ma-boston"


def write_nuplan(root: Path) -> Path:
    """Three logs of one city, and the map of another."""
    nuplan.write_raw(root, DRIVES, scene_seconds=2.0)
    maps, version = root / "maps", nuplan.VERSION
    shutil.copytree(maps / nuplan.LOCATION, maps / BOSTON)
    manifest = {place: {"version": version, "layers": {}} for place in (nuplan.LOCATION, BOSTON)}
    (maps / "nuplan-maps-v1.0.json").write_text(json.dumps(manifest))
    return root


def write_nuscenes(root: Path) -> Path:
    """Four scenes of two locations, two of them with a CAN bus."""
    for scene in nuscenes.write_invented(root, num_scenes=4, num_keyframes=21)[:2]:
        nuscenes.write_can_bus(root, scene)
    return root


def write_lyft(root: Path) -> Path:
    return lyft.write_dataset(root, num_scenes=4, num_frames=30)


def write_argoverse1(root: Path) -> Path:
    argoverse1.write_recordings(root / "train" / "data", 3)
    argoverse1.write_map(root / "map_files")
    argoverse1.write_map(root / "map_files", "MIA")
    return root


def write_argoverse2(root: Path) -> Path:
    argoverse2.write_forecasting(root / "forecasting", num_scenarios=3, num_tracks=12, num_timesteps=60)
    log = argoverse2.write_sensor_log(root / "sensor", seconds=3.5)
    (log / "map" / "ground_height_surface.npy").write_bytes(b"heights")
    return root


CASES = {
    "nuplan": (write_nuplan, "mini", {"past": 0.5}),
    "nuscenes": (write_nuscenes, "mini", {}),
    "nuscenes windows": (write_nuscenes, "mini", {"by": "window", "past": 1.0, "future": 3.0}),
    "lyft": (write_lyft, "train", {"window": 1.5}),
    "argoverse1": (write_argoverse1, "train", {}),
    "argoverse2": (write_argoverse2, "train", {}),
}
IMAGES = {
    "nuplan": "sensor_blobs/log/CAM_F0/1.jpg",
    "nuscenes": "samples/CAM_FRONT/1.jpg",
    "lyft": "aerial_map/1.png",
    "argoverse1": "images/1.jpg",
    "argoverse2": "sensor/log/sensors/lidar/1.feather",
}


@pytest.fixture(autouse=True)
def short_shards(monkeypatch):
    """Split small datasets into several shards; shards are planned in this process."""
    monkeypatch.setattr(lyft_converter, "_BLOCK", 2)
    monkeypatch.setattr(nuscenes_converter, "_SCENES_PER_SHARD", {"scene": 1, "window": 1})


def options_of(name, given):
    return converters.get(name).Options(**given)


@pytest.mark.long
@pytest.mark.parametrize("workers", [1, 2])
@pytest.mark.parametrize("case", CASES)
def test_bucket_gives_the_same_lake_as_a_folder(store, tmp_path, case, workers):
    name, (write, split, given) = case.split()[0], CASES[case]
    prefix = f"each/{case.replace(' ', '-')}-{workers}"
    raw = write(tmp_path / "raw")
    place = upload(raw, prefix)
    put({IMAGES[name]: b"image"}, prefix)
    store.set()
    how = {"split": split, "options": options_of(name, given), "workers": workers}
    remote = convert(name, place, tmp_path / "remote", **how)
    asked = fetched(store, prefix)
    local = convert(name, str(raw), tmp_path / "local", **how)
    assert (remote.converted, remote.quarantined, remote.failed) == (local.converted, local.quarantined, [])
    assert same(tmp_path / "remote", tmp_path / "local")
    listed = {path for path in asked if any(Path(path).match(each) for each in converters.get(name).listed)}
    assert all(times <= workers + (path in listed) + 1 for path, times in asked.items()), asked
    assert not {path for path in asked if path.endswith((".jpg", ".png", ".npy", "lidar/1.feather"))}
    again = convert(name, place, tmp_path / "remote", **how)
    assert (again.converted, again.skipped) == (0, convert(name, str(raw), tmp_path / "local", **how).skipped)
    assert set(fetched(store, prefix)) == listed


def test_only_required_chunks_of_a_recording_are_fetched(store, tmp_path):
    place = upload(write_lyft(tmp_path / "raw"), "few/lyft")
    store.set()
    report = convert("lyft", place, tmp_path / "lake", selection=InputSelection(files=slice(0, 1)), split="train")
    chunks = [path for path in fetched(store, "few/lyft") if "/agents/" in path and path[-1].isdigit()]
    assert report.converted == 1
    assert 0 < len(chunks) < len(list((tmp_path / "raw/scenes/sample.zarr/agents").glob("[0-9]*"))) / 2


@pytest.mark.long
def test_chunks_shared_by_neighbouring_shards_are_fetched_once(store, tmp_path):
    place = upload(write_lyft(tmp_path / "raw"), "neighbours/lyft")
    store.set()
    assert convert("lyft", place, tmp_path / "lake", split="train").shards == 3  # the map, and two scenes twice
    asked = fetched(store, "neighbours/lyft")
    assert set(asked.values()) == {1, 2}
    assert {path for path, times in asked.items() if times == 2} == {  # once to list them, once to convert them
        f"scenes/sample.zarr/{path}"
        for path in (".zattrs", "scenes/.zarray", "scenes/0", "frames/.zarray", "agents/.zarray",
                     "traffic_light_faces/.zarray")
    }  # fmt: skip


@pytest.mark.long
def test_log_fetches_only_the_map_of_its_city(store, tmp_path):
    raw, las_vegas = write_nuplan(tmp_path / "raw"), f"maps/{nuplan.LOCATION}/{nuplan.VERSION}/map.gpkg"
    logs = sorted(path.name for path in (raw / "splits" / "mini").iterdir())
    place = upload(raw, "cities/nuplan")
    store.set()
    how = {"split": "mini", "options": options_of("nuplan", {"past": 0.5})}
    convert("nuplan", place, tmp_path / "lake", selection=InputSelection(files=slice(0, 1)), **how)
    assert {path: times for path, times in fetched(store, "cities/nuplan").items() if "splits" not in path} == {
        las_vegas: 1,
        las_vegas.replace(nuplan.LOCATION, BOSTON): 1,  # not known yet that no log needs it
        "maps/nuplan-maps-v1.0.json": 2,
    }
    assert convert("nuplan", place, tmp_path / "lake", **how).skipped == 1
    assert fetched(store, "cities/nuplan") == {
        f"splits/mini/{logs[1]}": 1, f"splits/mini/{logs[2]}": 1, las_vegas: 1, "maps/nuplan-maps-v1.0.json": 2
    }  # fmt: skip


@pytest.mark.long
def test_maps_on_this_machine(store, tmp_path, monkeypatch):
    raw = write_nuplan(tmp_path / "raw")
    (raw / "maps").rename(tmp_path / "maps")
    place = upload(raw, "apart/nuplan")
    monkeypatch.setenv("NUPLAN_MAPS_ROOT", str(tmp_path / "maps"))
    how = {"split": "mini", "options": options_of("nuplan", {"past": 0.5})}
    convert("nuplan", place, tmp_path / "remote", **how)
    convert("nuplan", str(raw), tmp_path / "local", **how)
    assert same(tmp_path / "remote", tmp_path / "local")


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "write", "part"), [("nuscenes", write_nuscenes, "v1.0-mini"), ("lyft", write_lyft, "scenes/sample.zarr")]
)
def test_subset_of_a_dataset(store, tmp_path, name, write, part):
    raw, split = write(tmp_path / "raw"), "mini" if name == "nuscenes" else "train"
    place = upload(raw, f"part/{name}")
    convert(name, f"{place}/{part}", tmp_path / "remote", split=split)
    convert(name, str(raw / part), tmp_path / "local", split=split)
    assert same(tmp_path / "remote", tmp_path / "local")
