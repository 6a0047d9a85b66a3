"""Filters select the same scenarios as ScenarioNet's on the same pickles, except where its rules are known to be wrong.

Runs on recorded pickles where available, and on pickles written by our exporter.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scenarionet_data import Lake, ScenarioLoader, convert
from scenarionet_data.errors import BadParameter, DatabaseExists
from scenarionet_data.export import export
from tests.fixtures import scenarionet_rules as rules
from tests.fixtures.lakes import write_lake
from tests.fixtures.scenarionet_pickles import nuscenes, write_database
from tests.fixtures.scenarios import make_scenario, renamed

pytestmark = pytest.mark.integration

METRES = (0.0, 1.0, 5.0, 10.0, 60.0, 90.0, 120.0, 200.0, 1e6)
COUNTS = (0, 30, 31, 33, 52, 53, 100, 138, 139, 1000)


def named(scenario, name):
    return replace(renamed(scenario, name), source=replace(scenario.source, scenario_id=name))


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Three databases written by our exporter: short, crowded, and without heights."""
    root = tmp_path_factory.mktemp("written")
    kinds = {
        "short": {"num_steps": 11, "num_lights": 0},
        "crowded": {"num_objects": 33, "num_steps": 100},
        "flat": {"has_z": False},
    }
    for number, (name, how) in enumerate(kinds.items()):
        made = [named(make_scenario(seed, **how), f"{name}{seed}") for seed in range(number * 5, number * 5 + 5)]
        lake = write_lake(root / "lakes" / name, made)
        export(ScenarioLoader(lake), root / "pickles" / name)
    return root / "pickles"


@pytest.fixture(scope="module", params=["written", "recorded"])
def folder(request):
    """A folder with databases of pickles."""
    if request.param == "written":
        return request.getfixturevalue("written")
    return request.getfixturevalue("recordings") / "scenarionet"


@pytest.fixture(scope="module")
def theirs(folder):
    """ScenarioNet's databases, by name."""
    return {path.name: rules.read(path) for path in sorted(folder.iterdir())}


@pytest.fixture(scope="module")
def _ours(folder, tmp_path_factory):
    root = tmp_path_factory.mktemp("ours") / "lake"
    assert convert("scenarionet", str(folder), root).is_clean
    lake = Lake(root)
    for path in sorted(folder.iterdir()):
        lake.filter("starts_with(source_file, $folder)", name=path.name, parameters={"folder": f"{path.name}/"})
    return lake


@pytest.fixture
def names(_ours, request):
    """Save databases under numbered names and return the file names of their members."""
    made = []

    def ask(operation, *words, **more):
        name = f"{abs(hash(request.node.name))}_{len(made)}"
        made.append(getattr(_ours, operation)(*words, name=name, allow_empty=True, **more))
        return files_of(_ours, made[-1])

    return ask


def files_of(lake, database):
    """File names of a database's members, in order."""
    rows = lake.arrow("SELECT scenario_id, source_file FROM metadata").to_pydict()
    source = dict(zip(rows["scenario_id"], rows["source_file"], strict=True))
    return [source[name].rpartition("/")[2] for name in database.scenario_ids]


# --- filter -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("metres", METRES)
def test_filter_moving_dist(metres, theirs, names):
    wanted = rules.merge(theirs.values(), [rules.moves_further_than(metres)])
    assert set(names("filter", "ego_distance > $m", parameters={"m": metres})) == set(wanted)


@pytest.mark.parametrize("count", COUNTS)
def test_filter_num_object(count, theirs, names):
    wanted = rules.merge(theirs.values(), [rules.has_fewer_objects_than(count)])
    assert set(names("filter", "num_objects < $n", parameters={"n": count})) == set(wanted)


def test_filter_no_traffic_light(theirs, names):
    wanted = rules.merge(theirs.values(), [rules.has_no_traffic_light()])
    assert set(names("filter", filters=["no_traffic_light"])) == set(wanted)


def test_filter_no_overpass(theirs, names):
    wanted = rules.merge(theirs.values(), [rules.has_no_overpass()])
    assert set(names("filter", filters=["no_overpass"])) == set(wanted)


@pytest.mark.parametrize("metres", [1.0, 2.0, 8.0, 100.0])
def test_filter_no_overpass_includes_road_edges(metres, theirs, names):
    """ScenarioNet's rule considers only road lines, so with other limits ours may keep fewer."""
    wanted = rules.merge(theirs.values(), [rules.has_no_overpass(metres)])
    assert set(names("filter", filters=[f"no_overpass:max={metres}"])) <= set(wanted)


def test_filter_exclude_ids(theirs, names):
    everything = rules.merge(theirs.values())
    ids = [rules.scenario_id(summary) for summary, _ in everything.values()][::3]
    wanted = rules.merge(theirs.values(), [rules.is_none_of(ids)])
    found = names("filter", "NOT list_contains($ids, source_scenario_id)", parameters={"ids": ids})
    assert set(found) == set(wanted)
    assert len(found) == len(everything) - len(ids)


def test_filter_by_several_rules_within_a_database(theirs, names):
    for name, database in theirs.items():
        wanted = rules.merge([database], [rules.moves_further_than(5), rules.has_fewer_objects_than(130)])
        assert set(names("filter", "ego_distance > 5 AND num_objects < 130", database=name)) == set(wanted)


# --- merge, split, cp, num ----------------------------------------------------------------------------------------


def test_merge(theirs, names):
    first, second, *rest = theirs
    assert names("merge", first, second) == list(rules.merge([theirs[first], theirs[second]]))
    assert set(names("merge", first, second, *rest)) == set(rules.merge(theirs.values()))


def test_merge_of_overlapping_databases(theirs, names):
    first, second, *_ = theirs
    wanted = rules.merge([theirs[second], theirs[first], theirs[second]])
    assert names("merge", second, first, second) == list(wanted)


def test_merge_filter_moving_dist(theirs, names):
    wanted = rules.merge(theirs.values(), [rules.moves_further_than(5)])
    assert set(names("filter", "ego_distance > 5")) == set(wanted)


@pytest.mark.parametrize(("start", "count"), [(0, 1), (1, 1), (0, 2)])
def test_split_sequential(start, count, theirs, names):
    for name, database in theirs.items():
        if start + count <= len(database):
            place = {"first": start, "end": start + count}
            found = names("filter", "place >= $first AND place < $end", database=name, parameters=place)
            assert found == list(rules.split(database, start, count))


def test_split_random(theirs, names):
    name, database = max(theirs.items(), key=lambda item: len(item[1]))
    found = names("sample", name, n=2, seed=3)
    assert len(found) == 2
    assert set(found) < set(database)
    assert found == names("sample", name, n=2, seed=3)


def test_split_larger_than_the_database_is_refused(theirs, _ours):
    name, database = next(iter(theirs.items()))
    with pytest.raises(ValueError, match="wanted 99"):
        rules.split(database, 0, 99)
    with pytest.raises(BadParameter):
        _ours.sample(name, name="too_many", n=99)


def test_num_and_cp(theirs, _ours):
    for name, database in theirs.items():
        assert len(_ours.database(name)) == len(database)
        copied = _ours.copy(name, name=f"copy_of_{name}")
        assert files_of(_ours, copied) == list(database)
        _ours.drop(copied.name)


# --- defects of the original rules: its behaviour and ours -----------------------------------------------------------


def test_defect_maps_without_heights_are_dropped_as_overpasses(written, tmp_path):
    flat = rules.read(written / "flat")
    for _, path in flat.values():  # as converters of planar datasets write them
        content = rules.unpickle(path)
        for feature in content["map_features"].values():
            if "polyline" in feature:
                feature["polyline"] = feature["polyline"][:, :2]
        write_database(tmp_path / "flat", {path.name: content})
    flat = rules.read(tmp_path / "flat")
    assert rules.merge([flat], [rules.has_no_overpass_as_it_is()]) == {}
    convert("scenarionet", str(tmp_path / "flat"), tmp_path / "lake")
    assert len(Lake(tmp_path / "lake").filter(filters=["no_overpass"], name="level")) == len(flat)


def test_defect_ids_containing_an_excluded_id_are_dropped(tmp_path):
    write_database(tmp_path / "raw", {f"sd_{name}.pkl": nuscenes(name) for name in ("scene-1", "scene-11", "scene-2")})
    database, unwanted = rules.read(tmp_path / "raw"), ["scene-11"]
    assert list(rules.merge([database], [rules.is_none_of_as_it_is(unwanted)])) == ["sd_scene-2.pkl"]
    convert("scenarionet", str(tmp_path / "raw"), tmp_path / "lake")
    lake = Lake(tmp_path / "lake")
    kept = lake.subtract(lake.filter(name="all"), lake.filter(ids=unwanted, name="unwanted"), name="kept")
    assert sorted(files_of(lake, kept)) == ["sd_scene-1.pkl", "sd_scene-2.pkl"]


def test_defect_overwrite_is_always_true_in_split(written, tmp_path):
    """Their split wraps the flag in a tuple, which is always true: an old database is overwritten without a warning."""
    convert("scenarionet", str(written / "short"), tmp_path / "lake")
    lake = Lake(tmp_path / "lake")
    first = lake.sample(None, name="part", n=2)
    with pytest.raises(DatabaseExists, match="replace=True"):
        lake.sample(None, name="part", n=3)
    assert lake.database("part").scenario_ids == first.scenario_ids
    lake.sample(None, name="part", n=3, replace=True)
    assert (len(lake.database("part@1")), len(lake.database("part@2"))) == (2, 3)


def test_defect_files_of_equal_name_overwrite_each_other(tmp_path):
    """Folders of 0.pkl, 1.pkl, ... merge into one 0.pkl; ours are identified by scenario id."""
    for name in ("scene-1", "scene-2"):
        write_database(tmp_path / "raw" / name, {"0.pkl": nuscenes(name)})
    merged = rules.merge(rules.read(tmp_path / "raw" / name) for name in ("scene-1", "scene-2"))
    assert len(merged) == 1
    convert("scenarionet", str(tmp_path / "raw"), tmp_path / "lake")
    assert len(Lake(tmp_path / "lake").filter(name="both")) == 2


def test_defect_tracks_without_valid_steps_count_as_objects(written):
    counts = [
        (rules.num_objects(summary), rules.num_objects_as_it_is(summary))
        for summary, _ in rules.read(written / "crowded").values()
    ]
    assert all(seen <= listed for seen, listed in counts)
    assert any(seen < listed for seen, listed in counts)


def test_defect_summaries_of_2023_are_not_supported(recordings):
    """Their filters look up a key that old summaries lack; the oracle and our code know both forms."""
    for summary, _ in rules.read(recordings / "scenarionet" / "waymo_0").values():
        assert "num_objects" not in summary["number_summary"]
        assert rules.num_objects(summary) == rules.num_objects_as_it_is(summary) > 100


# --- round trip ----------------------------------------------------------------------------------------------------


def test_exported_database_converts_back_to_the_same_members_and_arrays(folder, _ours, tmp_path):
    members = list(ScenarioLoader(_ours, min(path.name for path in folder.iterdir())))
    export(members, tmp_path / "pickles")
    assert convert("scenarionet", str(tmp_path / "pickles"), tmp_path / "lake").is_clean
    loader = ScenarioLoader(tmp_path / "lake")
    returned = {scenario.source.scenario_id: scenario for scenario in loader}
    assert set(returned) == {scenario.source.scenario_id for scenario in members}
    for scenario in members:
        again = returned[scenario.source.scenario_id]
        assert list(again.tracks.ids) == list(scenario.tracks.ids)
        assert np.array_equal(again.timestamps, scenario.timestamps)
        for name in ("position", "heading", "velocity", "size", "valid"):
            assert np.array_equal(getattr(again.tracks, name), getattr(scenario.tracks, name)), name
        assert set(again.map.ids) == set(scenario.map.ids)
