"""Traffic on maps that were not generated: junctions, ends, lights, journeys, and every vehicle on a lane."""

from __future__ import annotations

import json
from itertools import product

import numpy as np
import pytest
import shapely

from scenarionet_data import Lake, convert
from scenarionet_data.building import MapBuilder
from scenarionet_data.converters import get
from scenarionet_data.errors import BadParameter, CorruptSource, SourceNotFound
from scenarionet_data.procedural.drawn_map import DrawnMap, DrawnPath
from scenarionet_data.procedural.roadmap import NO_JUNCTION
from scenarionet_data.scenario.vocabulary import MapFeatureType, is_lane
from scenarionet_data.testing import ConverterConformance, differences
from tests.fixtures.reading import scenarios

ORIGIN = np.array([500_000.0, 5_600_000.0, 0.0])


def crossing(with_lights: bool = True, is_closed: bool = False) -> MapBuilder:
    """Four one-way roads of two lanes into a crossing and out of it, straight on and to the right."""
    builder, exits, entries = MapBuilder(), {}, {}

    def link(before: str, after: str) -> None:
        exits.setdefault(before, []).append(after)
        entries.setdefault(after, []).append(before)

    lines = {}
    for arm, side in product(range(4), (0, 1)):
        turn = np.array([[0, 1], [-1, 0]]).T
        ahead = np.linalg.matrix_power(turn, arm) @ np.array([1.0, 0.0])
        right = np.array([ahead[1], -ahead[0]]) * (2.0 + 4.0 * side)
        into, out = np.array([-150 * ahead, -12 * ahead]) + right, np.array([12 * ahead, 150 * ahead]) + right
        lines |= {f"in{arm}{side}": into, f"out{arm}{side}": out}
        lines[f"on{arm}{side}"] = np.array([into[1], out[0]])
        link(f"in{arm}{side}", f"on{arm}{side}")
        link(f"on{arm}{side}", f"out{arm}{side}")
    if is_closed:
        for arm, side in product(range(4), (0, 1)):
            other = f"in{(arm + 2) % 4}{side}"
            lines[f"back{arm}{side}"] = np.array([lines[f"out{arm}{side}"][1], lines[other][0]])
            link(f"out{arm}{side}", f"back{arm}{side}")
            link(f"back{arm}{side}", other)
    for name, line in lines.items():
        beside = [name[:-1] + str(1 - int(name[-1]))]
        builder.add(
            name, MapFeatureType.LANE_SURFACE_STREET, polyline=line + ORIGIN[:2], width=(2.0, 2.0), speed_limit=10.0,
            exit_lanes=exits.get(name, []), entry_lanes=entries.get(name, []),
            left_neighbors=beside if name.endswith("1") else [], right_neighbors=beside if name.endswith("0") else [],
        )  # fmt: skip
    if with_lights:
        for arm in range(4):
            builder.add(
                f"light{arm}", MapFeatureType.TRAFFIC_LIGHT, polyline=[lines[f"in{arm}0"][1] + ORIGIN[:2]],
                controlled_lanes=[f"in{arm}0", f"in{arm}1"],
            )  # fmt: skip
    return builder


def drawn(**how) -> DrawnMap:
    return DrawnMap.of(crossing(**how).build(ORIGIN), ORIGIN)


def test_lanes_that_cross_are_one_junction_with_lights():
    lanes = drawn().lanes
    assert {name for name, lane in lanes.items() if lane.junction != NO_JUNCTION} == {
        f"on{arm}{side}" for arm in range(4) for side in (0, 1)
    }
    assert len({lane.junction for name, lane in lanes.items() if name.startswith("on")}) == 1
    axes = [lanes[f"on{arm}0"].axis for arm in range(4)]
    assert axes[0] == axes[2] != axes[1] == axes[3] and -1 not in axes
    assert all(lane.axis == -1 for lane in drawn(with_lights=False).lanes.values())
    assert lanes["out01"].end_name == lanes["out00"].end_name != lanes["out10"].end_name
    assert lanes["in00"].speed_limit == pytest.approx(10.0) and drawn().road.lane_width == pytest.approx(4.0)


def test_the_ego_starts_where_it_can_arrive():
    for seed in range(8):
        road_map = drawn().with_ends(np.random.default_rng(seed))
        assert road_map.start[0].startswith("in") and {goal[:4] for goal in road_map.goal} == {
            f"out{road_map.goal[0][3]}"
        }
    closed = drawn(is_closed=True)
    road_map = closed.with_ends(np.random.default_rng(0))
    ends = set(closed.lanes) - {before for before, _ in road_map.links}
    assert len(ends) == 8 and not any(closed.lanes[name].is_intersection for name in ends)


def test_paths_are_sampled_equally():
    path = DrawnPath(np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 4.0]]))
    points, headings = path.sample(1.0)
    assert path.length == 7.0 and len(points) == 8
    np.testing.assert_allclose(points[[0, 3, 7]], [[0, 0], [3, 0], [3, 4]])
    np.testing.assert_allclose(headings[[0, 7]], [0.0, np.pi / 2])
    pose = path.pose_at(5.0)
    assert (pose.x, pose.y, pose.heading) == (3.0, 2.0, pytest.approx(np.pi / 2))
    angle = np.linspace(0, np.pi / 2, 60)
    assert DrawnPath(20.0 * np.stack([np.cos(angle), np.sin(angle)], axis=1)).max_curvature == pytest.approx(
        0.05, abs=2e-3
    )


def write(folder, **how):
    features = []
    for row in crossing(**how)._rows:
        told = {"type": MapFeatureType(row["type"]).name, "width": 4.0, "speed_limit": 10.0}
        told |= {name: list(row[name]) for name in row if name.endswith(("_lanes", "_neighbors"))}
        shape, points = ("Point", row["polyline"][0]) if len(row["polyline"]) == 1 else ("LineString", row["polyline"])
        geometry = {"type": shape, "coordinates": points.tolist()}
        features.append({"type": "Feature", "id": row["id"], "properties": told, "geometry": geometry})
    path = folder / "crossing.geojson"
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    return path


class TestOnAMap(ConverterConformance):
    converter = get("pg")
    damaged_glob = None

    @pytest.fixture(scope="class")
    @classmethod
    def raw(cls, tmp_path_factory):
        cls.options = {"map": str(write(tmp_path_factory.mktemp("map"))), "density": 4.0}
        return "0:6"

    def test_contracts_hold(self, raw, tmp_path_factory):
        """As in the suite; lanes of given maps meet at angles, where velocities turn faster than in generated ones."""
        lake = tmp_path_factory.mktemp("lake") / "lake"
        convert("pg", raw, lake, options=self.options)
        from scenarionet_data.quality.checks import run_checks

        broken = {result.name for result in run_checks(lake).results if not result.is_met}
        assert broken <= {"velocity_is_motion"}

    def test_files_names_everything_that_is_read(self, raw, tmp_path_factory):
        """Seeds are no files."""

    def test_vehicles_are_on_lanes_and_apart(self, raw):
        for scenario in self.scenarios(raw):
            lines = [scenario.map.polyline[row][:, :2] for row in np.flatnonzero(is_lane(scenario.map.feature_type))]
            area = shapely.unary_union([shapely.LineString(line) for line in lines])
            tracks = scenario.tracks
            moving = [row for row, word in enumerate(tracks.source_type) if word in ("car", "van", "truck", "bus")]
            assert len(moving) > 3
            window = shapely.box(*scenario.map_crop).buffer(-20.0)
            for row in moving:
                places = shapely.points(tracks.position[row, tracks.valid[row], :2])
                inside = shapely.contains(window, places)
                assert (shapely.distance(places[inside], area) < 2.5).all()
            for step in range(0, scenario.num_timesteps, 20):
                here = [row for row in moving if tracks.valid[row, step]]
                places = tracks.position[here, step, :2]
                away = np.hypot(*(places[:, None] - places).transpose(2, 0, 1)) + 1e9 * np.eye(len(here))
                assert away.min(initial=1e9) > 1.8


def test_seeds_of_maps_and_of_generated_roads_share_a_lake(tmp_path):
    path = write(tmp_path)
    first = convert("pg", "0:2", tmp_path / "lake", options={"map": str(path)})
    second = convert("pg", "0:2", tmp_path / "lake")
    again = convert("pg", "0:2", tmp_path / "lake", options={"map": str(path)})
    assert (first.converted, second.converted, again.converted, again.failed) == (2, 2, 0, [])
    loaded = {scenario.id: scenario for scenario in Lake(tmp_path / "lake").loader()}
    assert set(loaded) == {"pg/v2/0", "pg/v2/1", "pg/v2/crossing-0", "pg/v2/crossing-1"}
    assert differences(loaded["pg/v2/0"], scenarios(get("pg"), "0:1")[0]) == []
    assert loaded["pg/v2/crossing-0"].map_id == "crossing"


def test_maps_without_traffic_are_refused(tmp_path):
    with pytest.raises(SourceNotFound, match="no such map"):
        scenarios(get("pg"), "0:1", map=str(tmp_path / "no.xodr"))
    (tmp_path / "bad.xodr").write_text("<OpenDRIVE/>")
    with pytest.raises(CorruptSource, match="expected lanes"):
        scenarios(get("pg"), "0:1", map=str(tmp_path / "bad.xodr"))
    builder = MapBuilder()
    builder.add("1", MapFeatureType.LANE_SURFACE_STREET, polyline=[[0, 0], [5, 0]])
    short = DrawnMap.of(builder.build(np.zeros(3)), np.zeros(3))
    with pytest.raises(BadParameter, match="25 m or more"):
        short.with_ends(np.random.default_rng(0))
    with pytest.raises(BadParameter, match="expected lanes"):
        DrawnMap.of(MapBuilder().build(np.zeros(3)), np.zeros(3))
