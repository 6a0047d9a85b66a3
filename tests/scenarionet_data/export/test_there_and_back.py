"""A database of pickles comes back from the lake as it was, but for the differences that the guide lists."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenarionet_data import Lake
from scenarionet_data.conversion import convert
from scenarionet_data.converters.scenarionet import ScenarioNetPickles
from scenarionet_data.converters.scenarionet.scenario import make_scenario as from_pickle
from scenarionet_data.export import export, export_database, to_pickle_dict
from scenarionet_data.export.original import to_original_dict
from scenarionet_data.ingest.options import Options
from scenarionet_data.ingest.shard import Shard
from scenarionet_data.scenario.content_hash import content_hash
from scenarionet_data.scenario.description import ScenarioDescription
from tests.fixtures import datasets
from tests.fixtures import scenarionet_pickles as made
from tests.fixtures.scenarios import make_scenario

GUIDE = Path(__file__).parents[3] / "docs" / "guides" / "pickles.md"
STEP, TURN, WIDTH = 2.0**-15, 2.0**-21, 2.0**-11

Bound = Callable[[Any, Any], Any]


def within(step: float) -> Bound:
    """Within ``step`` and float32's resolution of the value."""
    return lambda values, reach: step + np.spacing(np.abs(values).astype(np.float32))


def near(values: Any, reach: float) -> float:
    """As points: within ``STEP``, beyond 512 m within float32's resolution."""
    return max(STEP, resolution(values, reach))


def resolution(values: Any, reach: float) -> float:
    """Of float32 at the largest distance from the ego's first position."""
    return float(np.spacing(np.float32(reach)))


DIFFERENCES: dict[str, Bound] = {
    "tracks.*.state.position": near,
    "tracks.*.state.heading": within(TURN),
    "tracks.*.state.velocity": within(STEP),
    "tracks.*.state.length": within(STEP),
    "tracks.*.state.width": within(STEP),
    "tracks.*.state.height": within(STEP),
    "dynamic_map_states.*.stop_point": resolution,
    "map_features.*.polyline": near,
    "map_features.*.polygon": near,
    "map_features.*.position": near,
    "map_features.*.width": within(WIDTH),
    "metadata.ts": lambda values, reach: np.spacing(values),
    "metadata.object_summary.*.moving_distance": lambda value, _: 1e-3 * (1 + value),
    "metadata.object_summary.*.distance": lambda value, _: 1e-3 * (1 + value),
}
"""How far numbers may be from the recorded ones, given the values and the scenario's extent."""


def test_the_guide_lists_the_differences() -> None:
    table = GUIDE.read_text("utf-8").split("### What differs", 1)[1].split("\n#", 1)[0]
    rows = [row.split("|")[1] for row in table.splitlines() if row.startswith("| ")][2:]
    fields = {field for row in rows for field in row.split("`")[1::2]}
    assert fields == set(DIFFERENCES) | OTHERS
    assert len(rows) == 16


OTHERS = {"valid", "dataset_mapping.pkl", "dataset_summary.pkl", "numpy.float64", "OrderedDict", "0.pkl"}
"""Named in rows of the table about other differences."""


def prepared(description: dict[str, Any]) -> dict[str, Any]:
    """As the table has it: 0 where a state is not valid, headings in [-pi, pi), builtins for NumPy's scalars."""
    wanted = copy.deepcopy(description)
    for track in wanted["tracks"].values():
        valid = np.asarray(track["state"]["valid"]).reshape(-1) > 0.5
        for name, values in track["state"].items():
            if isinstance(values, np.ndarray) and name in (
                "position",
                "velocity",
                "heading",
                "length",
                "width",
                "height",
            ):
                values[~valid] = 0
        heading = track["state"]["heading"]
        if isinstance(heading, list):
            continue
        heading[valid] = heading[valid] - 2 * np.pi * np.floor((heading[valid] + np.pi) / (2 * np.pi))
    return wanted


def compare(wanted: Any, found: Any, extent: float, path: tuple[str, ...] = ()) -> Iterator[str]:
    """Yield every field that differs by more than the table permits."""
    where = ".".join(path)
    wanted = wanted.item() if isinstance(wanted, np.generic) else wanted
    if type(wanted) is not type(found):
        yield f"{where}: expected {type(wanted).__name__}, found {type(found).__name__}"
    elif isinstance(wanted, dict):
        for key in wanted.keys() ^ found.keys():
            yield f"{where}.{key}: {'is missing' if key in wanted else 'is added'}"
        for key in wanted.keys() & found.keys():
            yield from compare(wanted[key], found[key], extent, (*path, pattern(path, key)))
    elif isinstance(wanted, np.ndarray):
        if (wanted.dtype, wanted.shape) != (found.dtype, found.shape):
            yield f"{where}: expected {wanted.dtype} {wanted.shape}, found {found.dtype} {found.shape}"
        elif wanted.dtype.kind == "f" and where in DIFFERENCES:
            yield from compare_numbers(wanted, found, extent, where)
        elif not np.array_equal(wanted, found, equal_nan=wanted.dtype.kind == "f"):
            yield f"{where}: values differ"
    elif isinstance(wanted, list | tuple):
        if len(wanted) != len(found):
            yield f"{where}: expected {len(wanted)} items, found {len(found)}"
        for item, other in zip(wanted, found, strict=False):
            yield from compare(item, other, extent, path)
    elif isinstance(wanted, float) and where in DIFFERENCES:
        yield from compare_numbers(wanted, found, extent, where)
    elif wanted != found:
        yield f"{where}: expected {wanted!r}, found {found!r}"


def pattern(path: tuple[str, ...], key: Any) -> str:
    is_member = path in [("tracks",), ("dynamic_map_states",), ("map_features",), ("metadata", "object_summary")]
    return "*" if is_member else str(key)


def compare_numbers(wanted: Any, found: Any, extent: float, where: str) -> Iterator[str]:
    error = np.abs(np.asarray(wanted, np.float64) - np.asarray(found, np.float64))
    if where.endswith("heading"):
        error = np.minimum(error, np.abs(2 * np.pi - error))
    excess = error - DIFFERENCES[where](np.asarray(wanted, np.float64), extent)
    if not (excess <= 0).all():
        yield f"{where}: {error.max()} from the recorded value"


def extent_of(description: dict[str, Any]) -> float:
    """Largest distance of a point from the ego's first position [m], where float32 is coarsest."""
    tracks = {str(key): track for key, track in description["tracks"].items()}
    ego = tracks[description["metadata"]["sdc_id"]]["state"]["position"][0][:2]
    lines = [
        np.asarray(f[name])[:, :2]
        for f in description["map_features"].values()
        for name in f
        if name.startswith("poly")
    ]
    points = [np.asarray(t["state"]["position"])[:, :2] for t in tracks.values()]
    return float(max(np.nanmax(np.abs(line - ego)) for line in [*lines, *points]))


@pytest.mark.parametrize("source", ["made", pytest.param("recorded", marks=pytest.mark.long)])
def test_databases_come_back_as_they_were(source: str, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    if source == "made":
        raw = made.write_vintages(tmp_path / "raw")
    else:
        raw = request.getfixturevalue("recordings") / "scenarionet"
    lake, back = tmp_path / "lake", tmp_path / "back"
    assert convert("scenarionet", str(raw), lake).is_clean
    export_database(Lake(lake), None, back)
    pickles = {path.name: path for path in raw.rglob("*.pkl") if not path.name.startswith("dataset_")}
    found = [each for name, path in pickles.items() for each in differing(name, content(path), content(back / name))]
    assert found == []
    assert content(back / "dataset_mapping.pkl") == dict.fromkeys(pickles, "")
    summary = content(back / "dataset_summary.pkl")
    assert summary.keys() == pickles.keys()
    assert {path.name for path in back.iterdir()} == {*pickles, "dataset_mapping.pkl", "dataset_summary.pkl"}
    for path in raw.rglob("dataset_summary.pkl"):
        for name, wanted in content(path).items():
            extent = extent_of(content(pickles[name]))
            assert list(compare(summarised(wanted), summary[name], extent, ("metadata",))) == []


def summarised(value: Any, name: str = "") -> Any:
    """As entries of summaries are: arrays as lists, and sets, which have no order, as sorted tuples."""
    if isinstance(value, dict):
        return {key: summarised(inner, key) for key, inner in value.items()}
    if isinstance(value, set) or name == "num_object_types":
        return tuple(sorted(value))
    return value.tolist() if isinstance(value, np.ndarray) else value


def content(path: Path) -> Any:
    return pickle.loads(path.read_bytes())


def differing(name: str, wanted: Any, found: Any) -> list[str]:
    return [f"{name}: {each}" for each in compare(prepared(wanted), found, extent_of(wanted))]


def back(description: dict[str, Any]) -> dict[str, Any] | None:
    shard = Shard("scenarionet", "v1", "train", "s", "/raw", (), Options())
    return to_original_dict(from_pickle(shard, "sd_made.pkl", copy.deepcopy(description)))


def as_lists(description: dict[str, Any]) -> None:
    state = description["tracks"]["11"]["state"]
    state.update({name: values.tolist() for name, values in state.items()})


def with_numpy_scalars(description: dict[str, Any]) -> None:
    line = description["map_features"]["21"]["polyline"].astype(np.float64)
    description["map_features"]["21"]["polyline"] = [tuple(point) for point in line]


CHANGES: dict[str, Callable[[dict[str, Any]], Any]] = {
    "unknown keys": lambda d: [part.update(new={"a": (1, {2.5}), 3: np.arange(3)}) for part in parts(d)],
    "not finite": lambda d: d["metadata"].update(limit=float("inf"), known=[float("nan")] * 0),
    "keys that are int": lambda d: d.update(tracks={int(key): track for key, track in d["tracks"].items()}),
    "extra level": lambda d: d.update(comment="first try", none=None),
    "controls": lambda d: d["tracks"]["10"]["state"].update(steering=np.linspace(-1, 1, 41)[:, None]),
    "big endian": lambda d: d["tracks"]["10"]["state"].update(
        position=d["tracks"]["10"]["state"]["position"].astype(">f4")
    ),
    "limit of 0": lambda d: d["map_features"]["1"].update(speed_limit_mph=0.0, speed_limit_kmh=0.0),
    "wide lists": lambda d: d["map_features"]["1"].update(width=[[1.5, 1.75]] * 21),
    "other width": lambda d: d["map_features"]["1"].update(width=0),
    "no interpolating": lambda d: d["map_features"]["1"].pop("interpolating"),
    "interpolating": lambda d: d["map_features"]["1"].update(interpolating=True),
    "mixed links": lambda d: d["map_features"]["1"].update(entry_lanes=[1, "2"], exit_lanes=None),
    "records of int": lambda d: d["map_features"]["1"]["left_neighbor"][0].update(self_start_index=0),
    "lines as lists": lambda d: d["map_features"]["21"].update(polyline=d["map_features"]["21"]["polyline"].tolist()),
    "lines of scalars": with_numpy_scalars,
    "states as lists": as_lists,
    "lines of arrays": lambda d: d["map_features"]["21"].update(polyline=list(d["map_features"]["21"]["polyline"])),
    "stop point as list": lambda d: d["dynamic_map_states"]["3"].update(stop_point=[8350.0, 8904.0]),
    "states as array": lambda d: d["dynamic_map_states"]["3"]["state"].update(object_state=np.array(made.LIGHTS)),
    "no summaries": lambda d: [d["metadata"].pop(name) for name in ("object_summary", "number_summary")],
    "unknown feature": lambda d: d["map_features"].update(odd={"type": "TUNNEL", "polygon": np.ones((4, 2))}),
    "unknown object": lambda d: d["tracks"]["15"].update(type="HOVERCRAFT"),
    "no map": lambda d: d.update(map_features={}),
    "times as list": lambda d: d["metadata"].update(ts=[0.1 * k + 5 for k in range(41)]),
}  # fmt: skip


def parts(description: dict[str, Any]) -> list[dict[str, Any]]:
    track, feature = description["tracks"]["11"], description["map_features"]["31"]
    light = description["dynamic_map_states"]["3"]
    return [description, description["metadata"], track, track["metadata"], feature, light, light["metadata"]]


@pytest.mark.parametrize("change", CHANGES)
def test_fields_of_other_forms_come_back_as_they_were(change: str) -> None:
    description = made.waymo("a1")
    CHANGES[change](description)
    assert list(compare(prepared(description), back(description), extent_of(made.waymo("a1")))) == []


def test_oldest_lights_come_back_as_they_were() -> None:
    description = made.waymo("a1")
    light = description["dynamic_map_states"]["3"]
    light["state"] |= {"stop_point": np.tile(light.pop("stop_point"), (41, 1)), "lane": np.full(41, 3)}
    assert list(compare(prepared(description), back(description), 100.0)) == []


def test_changed_scenario_is_written_in_the_current_format() -> None:
    shard = Shard("scenarionet", "v1", "train", "s", "/raw", (), Options())
    scenario = from_pickle(shard, "sd_made.pkl", made.waymo("a1"))
    assert to_original_dict(scenario) is not None
    assert to_original_dict(replace(scenario, current_timestep=3)) is None


DATASETS = [name for name in datasets.WRITERS if name != "scenarionet"]


@pytest.mark.parametrize(
    "dataset", [name if name == "waymo" else pytest.param(name, marks=pytest.mark.long) for name in DATASETS]
)
def test_scenarios_of_the_lake_come_back_with_equal_content(dataset: str, tmp_path: Path) -> None:
    scenarios = {scenario.id: scenario for scenario in datasets.read(dataset, tmp_path / "raw").scenarios}
    report = export(scenarios.values(), tmp_path / "db")
    again = import_all(report.directory)
    assert {scenario.extras["pickle"]["scenario_uid"] for scenario in again} == set(scenarios)
    for scenario in again:
        first = scenarios[scenario.extras["pickle"]["scenario_uid"]]
        with_own_map = replace(first, map_id=None, map_crop=None)
        assert content_hash(scenario) == content_hash(with_own_map)
    export(again, tmp_path / "again")
    for path in report.directory.glob("sd_*.pkl"):
        wanted, found = (
            pickle.loads((folder / path.name).read_bytes()) for folder in (path.parent, tmp_path / "again")
        )
        assert not list(exactly(wanted, found))


def exactly(wanted: Any, found: Any) -> Iterator[str]:
    """Compare without the bounds of the table."""
    return compare({"content": wanted}, {"content": found}, 0.0)


@given(
    seed=st.integers(0, 10_000),
    num_lights=st.integers(0, 3),
    has_z=st.booleans(),
    has_map=st.booleans(),
)
@settings(max_examples=10)
def test_made_scenarios_come_back_with_equal_content(seed: int, num_lights: int, has_z: bool, has_map: bool) -> None:
    scenario = make_scenario(seed, num_lights=num_lights, has_z=has_z, has_map=has_map)
    shard = Shard("scenarionet", "v1", "train", "s", "/raw", (), Options())
    again = from_pickle(shard, "sd_made.pkl", to_pickle_dict(scenario))
    assert content_hash(again) == content_hash(scenario)


def import_all(directory: Path) -> list[ScenarioDescription]:
    converter = ScenarioNetPickles()
    shards = converter.shards(str(directory), "train", "v1", Options())
    return [converter.scenario(shard, record) for shard in shards for record in converter.records(shard)]
