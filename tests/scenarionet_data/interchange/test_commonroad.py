"""CommonRoad: scenarios written and read back differ in what the report says, and in nothing else."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as Xml

import numpy as np
import pytest

from scenarionet_data import Lake, convert
from scenarionet_data.errors import InvalidScenario
from scenarionet_data.interchange import writer_for
from scenarionet_data.interchange.base import Losses
from scenarionet_data.interchange.commonroad.layout import LANES, MARKS, MOVING, SOLUTION, STANDING
from scenarionet_data.interchange.commonroad.reader import CommonRoad
from scenarionet_data.interchange.lane_graph import boundary_type
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.scenario.vocabulary import LIGHT_COLORS, MapFeatureType, ObjectType, is_lane
from scenarionet_data.testing import ConverterConformance
from tests.fixtures.reading import scenarios
from tests.fixtures.scenarios import make_scenario, small
from tests.scenarionet_data.interchange.conformance import WriterConformance


class TestWriter(WriterConformance):
    name = "commonroad"


@pytest.mark.integration
class TestReader(ConverterConformance):
    converter = CommonRoad()
    damaged_glob = "*.xml"

    @pytest.fixture(scope="class")
    @classmethod
    def raw(cls, lake, tmp_path_factory):
        folder = tmp_path_factory.mktemp("raw")
        for number, scenario in enumerate(Lake(lake).loader()):
            write(scenario, folder, f"scene{number}")
        return folder


def write(scenario: ScenarioDescription, folder: Path, stem: str = "scene", **options: object) -> Losses:
    losses = Losses()
    folder.mkdir(exist_ok=True)
    for name, content in writer_for("commonroad", options).write(scenario, stem, losses).items():
        (folder / name).write_bytes(content)
    return losses


def read(folder: Path, **options: object) -> ScenarioDescription:
    (found,) = scenarios(CommonRoad(), folder, **options)
    found.validate()
    return found


def differing(before: ScenarioDescription, after: ScenarioDescription) -> set[str]:
    """What is not in the file, found by comparing, in the words of the report."""
    found = set[str]()

    def note(what: str, is_different: object) -> None:
        if bool(is_different):
            found.add(what)

    tracks, read = before.tracks, after.tracks
    seen = np.flatnonzero(tracks.valid.any(axis=1))
    ego = before.ego_index
    order = [row for row in seen if row != ego]
    standing = [row for row in order if _stands(before, row)]
    order = [*standing, *(row for row in order if row not in standing), ego]  # as the file has them
    note("objects that are never seen", len(seen) < len(tracks))
    assert np.array_equal(read.valid, tracks.valid[order])
    places = (tracks.position[order] + before.origin)[read.valid]
    np.testing.assert_allclose((read.position + after.origin)[read.valid][:, :2], places[:, :2], atol=1e-3)
    np.testing.assert_allclose(read.velocity, tracks.velocity[order], atol=2e-3)
    turned = np.abs(read.heading - tracks.heading[order])
    assert np.minimum(turned, 2 * np.pi - turned).max() < 1e-5
    note("heights of objects", len(seen))
    note("heights of positions, as the format's maps are flat", before.has_z)
    note("times of timesteps, which are evenly spaced", np.abs(before.timestamps - after.timestamps).max() > 1e-3)
    note("current timesteps, as planning begins with the first", before.current_timestep)
    size = np.abs(read.size - tracks.size[order])[..., :2].max(axis=2) * read.valid
    note("objects whose size changes", (size[:-1] > 0.01).any())
    note("sizes of egos, which are those of a BMW 320i", (size[-1, np.argmax(read.valid[-1])] > 0.01))
    note("types of objects that CommonRoad does not have", (read.object_type != tracks.object_type[order])[:-1].any())
    note("types of egos, which are vehicles", tracks.object_type[ego] != ObjectType.VEHICLE)
    note("objects of interest", before.objects_of_interest)
    note("tracks to predict", before.tracks_to_predict)
    note("times at which egos appear, as planning begins with the first timestep", not tracks.valid[ego, 0])
    ids, kept = [tracks.ids[row] for row in order], [*read.ids]
    note("ids of objects", ids != kept)
    assert after.ego_id == kept[-1]
    return found | differing_maps(before, after, note, found)


def _stands(scenario: ScenarioDescription, row: int) -> bool:
    tracks = scenario.tracks
    is_other = ObjectType(tracks.object_type[row]) not in MOVING
    return is_other and tracks.valid[row].all() and not np.ptp(tracks.position[row], axis=0).any()


def differing_maps(before, after, note, found) -> set[str]:
    features, read = before.map, after.map
    lanes = [row for row in np.flatnonzero(is_lane(features.feature_type)) if features.polyline.lengths[row] > 1]
    kept_lanes = np.flatnonzero(is_lane(read.feature_type))
    name_of = dict(zip(features.ids[lanes], read.ids[kept_lanes], strict=True))
    note("ids of map features", any(name != other for name, other in name_of.items()))
    for number, row in zip(kept_lanes, lanes, strict=True):
        line = features.polyline[row]
        if len(line) == len(read.polyline[number]):
            error = np.abs(read.polyline[number] + after.origin - line - before.origin)[:, :2].max()
            note("lanes whose centre is not in the middle", error > 2e-3)
        for name in ("entry_lanes", "exit_lanes"):
            assert {name_of[each] for each in getattr(features, name)[row] if each in name_of} <= set(
                getattr(read, name)[number]
            )
            note("links to lanes outside of the map", set(features.exit_lanes[row]) - set(name_of))
        for side in ("left", "right"):
            named = set(getattr(features, f"{side}_neighbors")[row])
            kept = set(getattr(read, f"{side}_neighbors")[number])
            assert kept <= {name_of.get(each) for each in named}
            if len(kept) < len(named):
                found.add("neighbours of lanes")
            mark = MARKS.get(boundary_type(features, row, is_left=side == "left"))
            kind = boundary_type(read, number, is_left=side == "left")
            assert (MARKS.get(kind) if kind is not None else None) == mark
        np.testing.assert_allclose(read.speed_limit[number], features.speed_limit[row], atol=1e-3)
        is_same = LANES[MapFeatureType(read.feature_type[number])] == LANES[MapFeatureType(features.feature_type[row])]
        assert is_same
        note("kinds of lanes that CommonRoad does not have", read.feature_type[number] != features.feature_type[row])
        note("that lanes are known to be no part of an intersection", features.is_intersection[row] == 0)
        assert (read.is_intersection[number] == 1) == (features.is_intersection[row] == 1)
    lights = [row for row, lane in enumerate(before.lights.lane_ids) if lane in name_of]
    note("traffic lights of lanes outside of the map", len(lights) < len(before.lights))
    assert len(after.lights) == len(lights)
    by_lane = sorted(lights, key=lambda row: [*name_of].index(before.lights.lane_ids[row]))
    assert np.array_equal(LIGHT_COLORS[after.lights.state], LIGHT_COLORS[before.lights.state[by_lane]])
    note("kinds of states of traffic lights beyond their color",
         (after.lights.state != before.lights.state[by_lane]).any())  # fmt: skip
    return found


def check(scenario: ScenarioDescription, folder: Path) -> None:
    losses = write(scenario, folder)
    told = {loss.what for loss in losses.found()}
    told = {"ids of objects" if what.startswith("ids of objects") else what for what in told}
    told = {"ids of map features" if what.startswith("ids of map features") else what for what in told}
    told = {"neighbours of lanes" if what.startswith("neighbours ") else what for what in told}
    # Said of features that are no lanes, which are compared below, and of widths, which no file has.
    others = ("map features of type", "stop lines", "ids of stop", "ids of crosswalks", "ids of traffic", "widths of",
              "lanes without two points")  # fmt: skip
    assert {what for what in told if not what.startswith(others)} == differing(scenario, read(folder))


@pytest.mark.integration
def test_generated_scenarios(lake, tmp_path):
    for number, scenario in enumerate(Lake(lake).loader()):
        check(scenario, tmp_path / str(number))


@pytest.mark.parametrize("seed", range(12))
def test_what_scenarios_may_have(tmp_path, seed):
    """Gaps, sizes that change, all types, heights, lights in several states, uneven times."""
    scenario = make_scenario(seed, has_z=bool(seed % 2))
    check(scenario, tmp_path / "scene")


def test_numbers_stay_and_are_given_once(lake, tmp_path):
    scenario = Lake(lake).loader()[0]
    ids = scenario.tracks.ids.copy()
    ids[1], ids[2], ids[3] = "5", "0", "007"
    changed = replace(scenario, tracks=replace(scenario.tracks, ids=ids))
    check(changed, tmp_path / "scene")
    root = Xml.parse(tmp_path / "scene" / "scene.xml").getroot()
    numbers = [element.get("id") for element in root if element.get("id")]
    assert len(set(numbers)) == len(numbers) and "5" in {each.get("id") for each in root.findall("dynamicObstacle")}


@pytest.mark.integration
def test_recorded_scenarios(recordings, tmp_path):
    convert("waymo", recordings / "waymo" / "training", tmp_path / "lake")
    convert("gpudrive", recordings / "gpudrive", tmp_path / "lake")
    for number, scenario in enumerate(Lake(tmp_path / "lake").loader()):
        check(scenario, tmp_path / str(number))


def test_things_that_stand_are_static(tmp_path):
    scenario = make_scenario(3, has_z=False)
    tracks = scenario.tracks
    types, valid = tracks.object_type.copy(), tracks.valid.copy()
    position, velocity, heading = tracks.position.copy(), tracks.velocity.copy(), tracks.heading.copy()
    size = tracks.size.copy()
    for row, kind in ((3, ObjectType.TRAFFIC_CONE), (4, ObjectType.TRAFFIC_BARRIER)):
        types[row], valid[row], velocity[row] = kind, True, 0.0
        position[row], heading[row], size[row] = (5.0 * row, 7.0, 0.0), 0.5, (1.0, 0.5, 1.0)
    changed = replace(scenario, tracks=replace(tracks, object_type=types, valid=valid, position=position,
                                               velocity=velocity, heading=heading, size=size))  # fmt: skip
    check(changed, tmp_path / "scene")
    root = Xml.parse(tmp_path / "scene" / "scene.xml").getroot()
    assert [each.findtext("type") for each in root.findall("staticObstacle")] == [
        STANDING[ObjectType.TRAFFIC_CONE], STANDING[ObjectType.TRAFFIC_BARRIER],
    ]  # fmt: skip


def test_without_a_solution_the_ego_has_its_start_and_goal(lake, tmp_path):
    scenario = Lake(lake).loader()[0]
    losses = write(scenario, tmp_path / "raw", solution=False)
    assert "paths of egos" in {loss.what for loss in losses.found()}
    found = read(tmp_path / "raw")
    valid = found.tracks.valid[found.ego_index]
    assert valid.sum() == 1 and valid[0]
    last = scenario.tracks.position[scenario.ego_index, scenario.tracks.valid[scenario.ego_index]][-1]
    goal = json.loads(found.tracks.extras[found.ego_index])["goal_position"]
    np.testing.assert_allclose(goal[:2], (last + scenario.origin)[:2], atol=1e-3)
    longest = read(tmp_path / "raw", ego="longest")
    assert longest.tracks.valid[longest.ego_index].sum() > 1
    assert len(longest.tracks) == len(found.tracks) - 1


def test_benchmarks_of_both_versions(recordings):
    found = {each.source.scenario_id: each for each in scenarios(CommonRoad(), recordings / "exchange" / "commonroad")}
    assert {name: (each.num_timesteps, len(each.tracks), each.dt) for name, each in found.items()} == {
        "ARG_Carcarana-4_5_T-1": (34, 9, 0.1),
        "DEU_A9-3_1_T-1": (31, 10, 0.2),
        "DEU_Muehlhausen-2_2_T-1": (37, 11, 0.1),
        "FRA_Anglet-1_1_T-1": (34, 9, 0.1),
        "USA_US101-3_3_T-1": (32, 13, 0.1),
    }
    assert not any(each.defects for each in found.values())
    limits = found["DEU_Muehlhausen-2_2_T-1"].map.speed_limit
    assert np.isfinite(limits).any()


def test_scenarios_without_lanes_are_refused():
    for scenario in (small(0, has_map=False), make_scenario(0, num_lanes=0)):
        with pytest.raises(InvalidScenario, match="CommonRoad demands, found none"):
            writer_for("commonroad").write(scenario, "scene", Losses())


def test_a_solution_of_another_problem_is_not_the_egos(lake, tmp_path):
    write(Lake(lake).loader()[0], tmp_path / "raw")
    path = tmp_path / "raw" / f"scene{SOLUTION}"
    path.write_text(path.read_text().replace('planningProblem="', 'planningProblem="9'))
    found = read(tmp_path / "raw")
    assert found.tracks.valid[found.ego_index].sum() == 1
