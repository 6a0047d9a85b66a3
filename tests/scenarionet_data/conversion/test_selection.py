"""Selecting recordings before conversion, and estimating its duration."""

from __future__ import annotations

import itertools
import pickle
from dataclasses import replace
from types import SimpleNamespace

import pytest

from scenarionet_data import Lake, convert
from scenarionet_data.conversion import InputSelection, Pace, measure_pace, parse_slice, plan_conversion
from scenarionet_data.errors import BadParameter
from scenarionet_data.ingest.options import Options
from scenarionet_data.ingest.shard import RawItem, Shard
from tests.fixtures.made import BUCKETED, NAME, MadeOptions, write_raw

FEW = MadeOptions(num_objects=2)


def shard(name: str, items: int, **properties: str) -> Shard:
    files = tuple(RawItem(f"{name}/{number}.raw", "0") for number in range(items))
    return Shard("made", "v1", "train", name, "/raw", files, Options(), properties)


SHARDS = [shard("a", 3, location="pit", date="2021-05-01"), shard("b", 2, location="miami"), shard("c", 2)]


def names(selection: InputSelection) -> list[str]:
    return [item.name for chosen in selection.select(SHARDS) for item in chosen.items]


def test_everything_is_selected_by_default() -> None:
    assert InputSelection().select(iter(SHARDS)) == SHARDS
    assert InputSelection({"location": "pit"}).select([]) == []


@pytest.mark.parametrize(
    ("where", "wanted"),
    [
        ({"location": "pit"}, ["a/0.raw", "a/1.raw", "a/2.raw"]),
        ({"location": "*i*"}, ["a/0.raw", "a/1.raw", "a/2.raw", "b/0.raw", "b/1.raw"]),
        ({"date": "2021-05-*", "file": "*/1.*"}, ["a/1.raw"]),
        ({"name": "[bc]", "file": "*0.raw"}, ["b/0.raw", "c/0.raw"]),
    ],
)
def test_where_selects_shards_and_inputs(where: dict[str, str], wanted: list[str]) -> None:
    assert names(InputSelection(where)) == wanted


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("0:2", ["a/0.raw", "a/1.raw"]),
        ("2:4", ["a/2.raw", "b/0.raw"]),
        ("5:", ["c/0.raw", "c/1.raw"]),
        (":1", ["a/0.raw"]),
        ("6:100", ["c/1.raw"]),
    ],
)
def test_files_slice_counts_inputs_over_all_shards(text: str, wanted: list[str]) -> None:
    assert names(InputSelection(files=parse_slice(text))) == wanted


def test_files_slice_applies_after_where() -> None:
    assert names(InputSelection({"location": "*"}, slice(2, 4))) == ["a/2.raw", "b/0.raw"]
    assert names(InputSelection({"location": "miami"}, slice(1, None))) == ["b/1.raw"]


def test_invalid_selections_are_refused() -> None:
    with pytest.raises(
        BadParameter, match="unknown property 'city': inputs can be selected by date, file, location, name"
    ):
        InputSelection({"city": "pit"}).select(SHARDS)
    with pytest.raises(BadParameter, match="the selection matches nothing in 3 shards; values of location: miami, pit"):
        InputSelection({"location": "boston"}).select(SHARDS)
    with pytest.raises(BadParameter, match="there are 7 raw inputs, numbered from 0"):
        InputSelection(files=slice(7, 9)).select(SHARDS)


@pytest.mark.parametrize("text", ["", "3", "a:b", "-1:", "1:2:3"])
def test_invalid_slices_are_refused(text: str) -> None:
    with pytest.raises(BadParameter, match="START:END"):
        parse_slice(text)


def test_properties_are_pickled_but_not_part_of_the_key() -> None:
    first, same = SHARDS[0], shard("a", 3)
    assert first.key("1") == same.key("1")
    assert pickle.loads(pickle.dumps(first)) == first
    assert hash(first) == hash(same)


@pytest.mark.parametrize("dataset", [NAME, BUCKETED])
def test_remaining_inputs_are_converted_later(dataset: str, tmp_path) -> None:
    raw, root = tmp_path / "raw", tmp_path / "lake"
    write_raw(raw, {name: [number] for number, name in enumerate("abcde")})
    some = convert(dataset, str(raw), root, options=FEW, selection=InputSelection({"file": "[ab]*"}))
    assert some.converted == 2
    more = convert(dataset, str(raw), root, options=FEW, selection=InputSelection(files=slice(0, 4)))
    rest = convert(dataset, str(raw), root, options=FEW)
    assert more.converted + rest.converted == 3
    found = Lake(root).sql("SELECT scenario_id FROM metadata")["scenario_id"].to_list()
    assert len(found) == len(set(found)) == 5


@pytest.mark.long
def test_pace_is_measured_without_leaving_files(tmp_path, monkeypatch) -> None:
    ticks = itertools.count()  # a clock that advances by a second whenever it is read
    monkeypatch.setattr("scenarionet_data.conversion.pace.time", SimpleNamespace(monotonic=lambda: float(next(ticks))))
    raw = write_raw(tmp_path / "raw", {f"f{number}": [number] for number in range(12)})
    plan = plan_conversion(BUCKETED, str(raw), tmp_path / "lake", options=FEW)
    pace = measure_pace(BUCKETED, plan.shards, budget=60.0)
    assert pace is not None
    assert (pace.inputs, pace.scenarios) == (4, 4)  # 1 and 1 and 2 and 4 before
    assert (pace.seconds, pace.start) == (0.25, 0.75)
    assert not (tmp_path / "lake").exists()
    assert measure_pace(BUCKETED, plan.shards, budget=0.0).inputs == 1
    assert measure_pace(BUCKETED, ()) is None
    write_raw(raw, {f"f{number}": ["corrupt"] for number in range(12)})
    assert measure_pace(BUCKETED, plan.shards) is None


def test_pace_scales_with_inputs_and_workers() -> None:
    pace = Pace(seconds=2.0, inputs=4, scenarios=40)
    assert pace.duration(100, 4) == 50.0
    assert pace.duration(2, 16) == 2.0
    assert pace.duration(0, 4) == 0.0
    assert replace(pace, start=30.0).duration(100, 4) == 80.0
    assert replace(pace, start=30.0).duration(0, 4) == 0.0
