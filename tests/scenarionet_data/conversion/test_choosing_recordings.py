"""Properties of recordings known before conversion, for every dataset: selection and dry runs."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from scenarionet_data import Lake, convert, converters
from scenarionet_data.conversion import InputSelection, measure_pace, plan_conversion
from scenarionet_data.interchange import writer_for
from scenarionet_data.interchange.files import write_files
from tests.fixtures import (
    argoverse1,
    argoverse2,
    interaction,
    lyft,
    nuplan,
    nuplan_drive,
    nuscenes,
    scenarionet_pickles,
    waymo,
)


def _waymo(raw: Path) -> Path:
    for number in range(2):
        name = f"training.tfrecord-{number:05d}-of-01000"
        waymo.write_tfrecord(raw / name, [waymo.scenario_bytes(number)])
    return raw


def _argoverse1(raw: Path) -> Path:
    for city in ("PIT", "MIA"):
        argoverse1.write_recordings(raw / "train" / city, num_files=2, city=city)
        argoverse1.write_map(raw, city)
    return raw


def _argoverse2(raw: Path) -> Path:
    argoverse2.write_forecasting(raw / "motion", num_scenarios=2, num_tracks=4)
    argoverse2.write_sensor_log(raw / "sensor", seconds=1.0)
    return raw


def _nuscenes(raw: Path) -> Path:
    nuscenes.write_invented(raw, num_scenes=3)
    return raw


def _nuplan(raw: Path) -> Path:
    return nuplan.write_raw(raw, [nuplan_drive.invented()], tags=[(20, "unprotected_left", None), (30, "stop", None)])


def _interaction(raw: Path) -> Path:
    interaction.write_map(raw)
    interaction.write_recording(raw, 0)
    return interaction.write_recording(raw, 1)


def _table(raw: Path) -> Path:
    (raw / "a.csv").write_text("track,time,x,y\n1,0,0,0\n1,0.1,1,0\n")
    return raw


def _training(raw: Path, dataset: str) -> Path:
    convert("pg", "0:1", raw / "lake")
    write_files(Lake(raw / "lake").loader(), raw / "files", writer_for(dataset))
    return raw / "files"


def _pg(_raw: Path) -> str:
    return "0:3"


WRITE: dict[str, Callable[[Path], Path | str]] = {
    "argoverse1": _argoverse1,
    "argoverse2": _argoverse2,
    "commonroad": lambda raw: _training(raw, "commonroad"),
    "gpudrive": lambda raw: _training(raw, "gpudrive"),
    "interaction": _interaction,
    "logical": lambda _raw: "cut_in",
    "lyft": lambda raw: lyft.write_dataset(raw, num_scenes=3, num_frames=20),
    "nuplan": _nuplan,
    "nuscenes": _nuscenes,
    "openscenario": lambda raw: _training(raw, "openscenario"),
    "pg": _pg,
    "pufferdrive": lambda raw: _training(raw, "pufferdrive"),
    "scenarionet": scenarionet_pickles.write_vintages,
    "sumo": lambda raw: _training(raw, "sumo"),
    "table": _table,
    "waymo": _waymo,
}
SPLIT = {"nuscenes": "mini", "nuplan": "mini"}


@pytest.fixture(scope="module")
def raws(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], str]:
    """The raw folder of each dataset, written once."""
    written: dict[str, str] = {}

    def raw(dataset: str) -> str:
        if dataset not in written:
            written[dataset] = str(WRITE[dataset](tmp_path_factory.mktemp(dataset)))
        return written[dataset]

    return raw


def test_every_dataset_is_covered() -> None:
    assert set(WRITE) == set(converters.names())


@pytest.mark.parametrize("dataset", WRITE)
def test_properties_match_declaration_and_are_picklable(dataset: str, raws: Callable[[str], str]) -> None:
    converter = converters.get(dataset)
    options = converter.Options()
    shards = list(converter.shards(raws(dataset), SPLIT.get(dataset, "train"), converter.release, options))
    told = {key for shard in shards for item in shard.items for key in (*shard.properties, *item.properties)}
    assert told == set(converter.properties)
    assert pickle.loads(pickle.dumps(shards)) == shards


@pytest.mark.parametrize(
    ("dataset", "where", "inputs"),
    [
        ("argoverse1", {"location": "MIA"}, 2),
        ("argoverse2", {"location": "austin"}, 2),
        ("argoverse2", {"location": "PIT", "kind": "sensor"}, 1),
        ("lyft", {"date": "2019-10-*", "location": "Palo Alto"}, 3),
        ("lyft", {"host": "host-a10*", "log": "host-a10*"}, 3),
        ("lyft", {"file": "*:1"}, 1),
        ("nuplan", {"location": "us-nv-*", "tag": "unprotected_*"}, 1),
        ("nuplan", {"date": "20*-*"}, 1),
        ("nuscenes", {"location": "boston-*"}, 1),
        ("nuscenes", {"log": "n015-singapore*", "date": "2018-*"}, 2),
        ("pg", {"file": "2"}, 1),
        ("scenarionet", {"dataset": "waymo"}, 2),
        ("waymo", {"file": "*-00001-of-*"}, 1),
    ],
)
def test_where_selects_recordings(
    dataset: str, where: dict[str, str], inputs: int, raws: Callable[[str], str], tmp_path: Path
) -> None:
    def planned(**selection: Any) -> int:
        plan = plan_conversion(
            dataset, raws(dataset), tmp_path, split=SPLIT.get(dataset, "train"), selection=InputSelection(**selection)
        )
        return sum(len(shard.items) for shard in plan.shards)

    assert planned(where=where) == inputs
    assert inputs < planned() or where.keys() & {"date", "location", "log", "host", "tag"}


@pytest.mark.long
@pytest.mark.parametrize("dataset", WRITE)
def test_dry_run_estimates_duration(dataset: str, raws: Callable[[str], str], tmp_path: Path) -> None:
    plan = plan_conversion(dataset, raws(dataset), tmp_path / "lake", split=SPLIT.get(dataset, "train"))
    pace = measure_pace(dataset, plan.shards, budget=0.0)
    assert pace is not None
    assert pace.scenarios > 0
    assert pace.seconds > 0
    assert pace.duration(1000, 2) == pytest.approx(pace.start + 500 * pace.seconds)
    assert not (tmp_path / "lake").exists()
