"""Databases of pickles are written completely and import back unchanged."""

from __future__ import annotations

import pickle
import random
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarionet_data.converters.scenarionet import ScenarioNetPickles
from scenarionet_data.converters.scenarionet.unpickling import load
from scenarionet_data.errors import BadParameter, DatabaseExists, InvalidScenario
from scenarionet_data.export import export, pickling
from scenarionet_data.export.pickling import dump
from scenarionet_data.ingest.options import Options
from scenarionet_data.scenario.content_hash import content_hash
from scenarionet_data.scenario.description import ScenarioDescription, make_scenario_id
from scenarionet_data.scenario.vocabulary import MapFeatureType
from scenarionet_data.testing import differences
from tests.fixtures import scenarionet_pickles as made
from tests.fixtures.lakes import everything
from tests.fixtures.scenarios import make_scenario, renamed

CONVERTER = ScenarioNetPickles()


def import_all(directory: Path) -> list[ScenarioDescription]:
    shards = CONVERTER.shards(str(directory), "train", "v1", Options())
    return [CONVERTER.scenario(shard, record) for shard in shards for record in CONVERTER.records(shard)]


class Evil:
    """Leaves a file behind where it is unpickled."""

    def __init__(self, mark: Path) -> None:
        self.mark = mark

    def __reduce__(self) -> Any:
        return Path.touch, (self.mark,)


def test_workers_unpickle_nothing_from_the_draft(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Others may write into the folder: whatever is in it when a part begins could be of theirs."""
    monkeypatch.setattr(pickling, "PART", 1)
    num_replaced, mark = 0, tmp_path / "executed"

    def executor(parts: Iterable[Any], do: Callable[[Any], Any], _: Any = None) -> Iterator[Any]:
        nonlocal num_replaced
        for part in parts:
            (part.draft / "scenarios.pkl").write_bytes(pickle.dumps(Evil(mark)))
            for path in filter(Path.is_file, part.draft.rglob("*")):
                path.write_bytes(pickle.dumps(Evil(mark)))
                num_replaced += 1
            yield do(part)

    export([make_scenario(seed) for seed in (1, 2)], tmp_path / "db", executor=executor)
    assert num_replaced > 2
    assert not mark.exists()
    pickle.loads(pickle.dumps(Evil(mark)))
    assert mark.exists()


def test_export_writes_a_database(tmp_path: Path) -> None:
    scenarios = [make_scenario(seed) for seed in (3, 1, 2)]
    done: list[tuple[int, int]] = []
    report = export(
        iter(scenarios), tmp_path / "new" / "db", on_progress=lambda number, total, _: done.append((number, total))
    )
    names = [f"sd_made_v1_s00000{seed}.pkl" for seed in (3, 1, 2)]
    assert report.directory == tmp_path / "new" / "db"
    assert (report.num_scenarios, report.refused, done) == (3, (), [(1, 0), (2, 0), (3, 0)])
    assert report.num_bytes == sum((report.directory / name).stat().st_size for name in names)
    assert {p.name for p in report.directory.iterdir()} == {*names, "dataset_summary.pkl", "dataset_mapping.pkl"}
    assert [p.name for p in report.directory.parent.iterdir()] == ["db"]
    summary = load(report.directory / "dataset_summary.pkl", "summary")
    assert list(summary) == names
    assert load(report.directory / "dataset_mapping.pkl", "mapping") == dict.fromkeys(names, "")
    assert not any(isinstance(value, np.ndarray | set) for _, value in made.walk(summary))
    assert summary[names[0]]["ts"] == scenarios[0].timestamps.tolist()
    assert summary[names[0]]["object_summary"]["t0"]["moving_distance"] == pytest.approx(30, rel=0.02)


def test_pickles_load_in_numpy_1_and_2(tmp_path: Path) -> None:
    """Names that numpy 1.26 and 2 share; protocol 4, whose arrays are writable after loading."""
    directory = export([make_scenario(1)], tmp_path / "db").directory
    for path in directory.iterdir():
        data = path.read_bytes()
        assert data[:2] == b"\x80\x04"
        assert b"_core" not in data and b"multiarray" not in data
        for where, value in made.walk(pickle.loads(data)):
            assert not isinstance(value, np.ndarray) or value.flags.writeable, where
            assert not isinstance(value, np.ndarray) or value.dtype.isnative, where


def test_file_names_are_scenario_files(tmp_path: Path) -> None:
    odd = replace(make_scenario(1), id=make_scenario_id("made", "v 1", "log/7 é", start=12))
    (path,) = [p for p in export([odd], tmp_path / "db").directory.iterdir() if p.name.startswith("sd_")]
    assert path.name == "sd_made_v%201_log%2F7%20%C3%A9@12.pkl"
    imported = made.metadrive(3)
    made.write_pickle(imported, tmp_path / "pg" / "sd_x.pkl")
    report = export(import_all(tmp_path / "pg"), tmp_path / "again")
    assert (report.directory / "sd_x.pkl").is_file()


def test_second_file_of_a_name_is_named_after_its_scenario(tmp_path: Path) -> None:
    for folder, seed in (("a", 3), ("b", 4)):
        made.write_pickle(made.metadrive(seed), tmp_path / "pg" / folder / "0.pkl")
    report = export(import_all(tmp_path / "pg"), tmp_path / "db")
    names = {path.name for path in report.directory.glob("*.pkl") if not path.name.startswith("dataset_")}
    assert names in [{"0.pkl", f"sd_metadrive_MetaDrive%20v0.4.3_PGMap-{seed}.pkl"} for seed in (3, 4)]
    assert report.refused == ()


def test_existing_directory_is_refused(tmp_path: Path) -> None:
    db = tmp_path / "db"
    export([make_scenario(1)], db)
    with pytest.raises(DatabaseExists, match="is not empty"):
        export([make_scenario(2)], db)
    assert (db / "sd_made_v1_s000001.pkl").is_file()
    export([make_scenario(2)], db, replace=True)
    assert {p.name for p in db.glob("sd_*")} == {"sd_made_v1_s000002.pkl"}
    (tmp_path / "empty").mkdir()
    export([make_scenario(2)], tmp_path / "empty")
    assert (tmp_path / "empty" / "dataset_summary.pkl").is_file()


def test_overwriting_keeps_files_that_are_not_part_of_a_database(tmp_path: Path) -> None:
    (tmp_path / "home").mkdir()
    (tmp_path / "home" / "thesis.tex").write_text("x")
    with pytest.raises(DatabaseExists, match=r"thesis\.tex"):
        export([make_scenario(1)], tmp_path / "home", replace=True)
    with pytest.raises(DatabaseExists):
        export([make_scenario(1)], tmp_path / "home" / "thesis.tex", replace=True)
    assert (tmp_path / "home" / "thesis.tex").read_text() == "x"


def test_failed_run_leaves_everything_unchanged(tmp_path: Path) -> None:
    def broken() -> Iterator[ScenarioDescription]:
        yield make_scenario(2)
        raise RuntimeError("the disk is on fire")

    export([make_scenario(1)], tmp_path / "db")
    for name in ("db", "other"):
        with pytest.raises(RuntimeError):
            export(broken(), tmp_path / name, replace=True)
    assert [p.name for p in tmp_path.iterdir()] == ["db"]
    assert [s.source.scenario_id for s in import_all(tmp_path / "db")] == ["s000001"]


def test_scenarios_that_cannot_be_exported_are_reported(tmp_path: Path) -> None:
    same = renamed(make_scenario(2), "s000001")
    report = export([make_scenario(1), same, make_scenario(3)], tmp_path / "db")
    assert report.num_scenarios == 2
    assert [error.scenario_id for error in report.refused] == ["made/v1/s000001"]
    assert "a second time" in report.refused[0].reason
    nameless = replace(make_scenario(1), dataset="scenarionet", extras={})
    with pytest.raises(InvalidScenario, match=r"extras\.dataset"):
        export([nameless], tmp_path / "none")
    with pytest.raises(BadParameter, match="no scenarios to export"):
        export([], tmp_path / "none")
    assert not (tmp_path / "none").exists()


@pytest.mark.parametrize("parts", [False, True])
def test_id_too_long_for_a_file_name_is_left_out(tmp_path: Path, parts: bool) -> None:
    fits, too_long = renamed(make_scenario(1), "x" * 240), renamed(make_scenario(2), "x" * 241)
    accented = renamed(make_scenario(3), "é" * 41)  # six bytes each in the file's name
    report = export([fits, too_long, accented], tmp_path / "db", executor=InProcess() if parts else None)
    assert [error.scenario_id for error in report.refused] == [too_long.id, accented.id]
    assert [error.field for error in report.refused] == ["id", "id"]
    assert "found one of 256 bytes" in report.refused[0].reason
    assert [scenario.source.scenario_id for scenario in import_all(tmp_path / "db")] == [fits.source.scenario_id]


class InProcess:
    """Runs jobs in this process."""

    def __call__(self, jobs: Any, run: Any, _lost: Any) -> Iterator[Any]:
        return map(run, jobs)


def test_equal_scenarios_give_equal_bytes(tmp_path: Path) -> None:
    scenarios = [make_scenario(seed, num_lights=2) for seed in (1, 2)]
    copies = pickle.loads(pickle.dumps(scenarios))  # no two objects are one, as in another process
    first = export(scenarios, tmp_path / "first").directory
    second = export(copies, tmp_path / "second", executor=InProcess()).directory
    assert everything(first) == everything(second)
    assert len(everything(first)) == 4


@pytest.mark.long
@given(members=st.sets(st.text(max_size=3), min_size=2), order=st.randoms(use_true_random=False))
def test_order_of_sets_and_identity_of_texts_do_not_matter(members: set[str], order: random.Random) -> None:
    shuffled = [*members]
    order.shuffle(shuffled)
    again = ["".join(list(text)) for text in shuffled]
    value = {"types": members, "names": sorted(members), "more": tuple(sorted(members))}
    other = {"types": set(again), "names": sorted(shuffled), "more": tuple(sorted(again))}
    files = [Path(tempfile.mkdtemp()) / "x.pkl" for _ in range(2)]
    for file, content in zip(files, (value, other), strict=True):
        dump(content, file)
    assert files[0].read_bytes() == files[1].read_bytes()
    assert pickle.loads(files[0].read_bytes()) == value
    for file in files:
        shutil.rmtree(file.parent)


def assert_same(first: ScenarioDescription, second: ScenarioDescription) -> None:
    """Compare everything but names."""
    names = ("id", "dataset", "version", "source", "extras", "split")
    for name in set(first.__dataclass_fields__) - set(names):
        assert differences(getattr(first, name), getattr(second, name), name) == []
    for name in ("scenario_id", "licence", "log", "city", "date", "crs"):
        assert getattr(first.source, name) == getattr(second.source, name)
    assert without_layout(first) == without_layout(second)


def without_layout(scenario: ScenarioDescription) -> dict[str, Any]:
    return {key: value for key, value in scenario.extras.items() if key != "pickle"}


@given(
    seed=st.integers(0, 10_000),
    num_objects=st.integers(2, 12),
    num_steps=st.integers(2, 40),
    num_lights=st.integers(0, 3),
    has_z=st.booleans(),
    has_map=st.booleans(),
    interpolated=st.sampled_from([0.0, 0.3]),
)
def test_export_and_import_give_equal_arrays(
    tmp_path_factory, seed, num_objects, num_steps, num_lights, has_z, has_map, interpolated
):
    scenario = make_scenario(
        seed,
        num_objects=num_objects,
        num_steps=num_steps,
        num_lights=num_lights,
        has_z=has_z,
        has_map=has_map,
        interpolated=interpolated,
    )
    (again,) = import_all(export([scenario], tmp_path_factory.mktemp("round") / "db").directory)
    again.validate()
    assert_same(scenario, again)
    assert again.id == f"scenarionet/v1/made_s{seed:06d}"
    assert content_hash(again) == content_hash(scenario)


def test_nuscenes_ego_is_restored_exactly(tmp_path: Path) -> None:
    scenario = make_scenario(2, dataset="nuscenes", version="v1.0-mini")
    (again,) = import_all(export([scenario], tmp_path / "db").directory)
    assert_same(scenario, again)


@pytest.mark.parametrize("source", ["made", "recorded"])
def test_imported_pickles_export_and_import_unchanged(
    source: str, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    if source == "made":
        raw = made.write_vintages(tmp_path / "raw")
    else:
        raw = request.getfixturevalue("recordings") / "scenarionet"
    first = {scenario.id: scenario for scenario in import_all(raw)}
    report = export(first.values(), tmp_path / "db")
    assert not report.refused
    second = {scenario.id: scenario for scenario in import_all(report.directory)}
    assert second.keys() == first.keys()
    for scenario_id, scenario in first.items():
        assert_same(scenario, second[scenario_id])
        assert scenario.map.feature_type.tolist() == second[scenario_id].map.feature_type.tolist()
        assert MapFeatureType.LANE_SURFACE_STREET in scenario.map.feature_type
