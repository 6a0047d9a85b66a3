"""From lane graphs to roads, on graphs drawn by hand and generated ones."""

import numpy as np
import pytest

from scenarionet_data import ScenarioLoader
from scenarionet_data.building import MapBuilder
from scenarionet_data.interchange.base import Losses
from scenarionet_data.interchange.curves import distinct, fit, joining, through, trimmed
from scenarionet_data.interchange.roads import lane_end, lane_width, make_roads
from scenarionet_data.scenario.vocabulary import MapFeatureType, is_lane

LANE = MapFeatureType.LANE_SURFACE_STREET


def straight(x0, x1, y):
    return [[x, y, 0.0] for x in np.linspace(x0, x1, 5)]


def built(*lanes):
    builder = MapBuilder()
    for name, points, more in lanes:
        builder.add(name, LANE, polyline=points, width=[[1.75, 1.75]], **more)
    return builder.build(np.zeros(3))


def test_a_curve_through_a_circle_is_one():
    angle = np.linspace(0.0, np.pi / 2, 10)
    points = np.stack([20.0 * np.cos(angle), 20.0 * np.sin(angle), np.zeros(10)], axis=1)
    curve = through(points)
    samples, stations, tangents = curve.sample(0.1)
    assert curve.length == pytest.approx(20.0 * np.pi / 2, abs=1e-3)
    np.testing.assert_allclose(np.hypot(*samples.T), 20.0, atol=2e-3)
    np.testing.assert_allclose(np.einsum("sk,sk->s", samples, tangents), 0.0, atol=0.05)
    assert (np.diff(stations) > 0.0).all()


def test_straight_points_are_left_out_and_kinks_are_kept():
    line = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [10, 0, 0]])
    assert len(fit(line).coefficients) == 1
    kinked = np.array([[0.0, 0, 0], [10, 0, 0], [10, 10, 0]])
    drawn = fit(kinked).sample(0.1)[0]
    assert min(np.hypot(*(drawn - [10, 0]).T)) < 0.02


def test_trimmed_and_distinct():
    line = np.array([[0.0, 0, 0], [0, 0, 0], [4, 0, 1], [10, 0, 1]])
    assert len(distinct(line)) == 3
    np.testing.assert_allclose(trimmed(distinct(line), 2.0, 0.5), [[1, 0, 0.25], [4, 0, 1], [9.5, 0, 1]])
    assert trimmed(distinct(line), 0.0, 0.0).tolist() == distinct(line).tolist()


def test_joining_keeps_both_directions():
    curve = joining(np.zeros(3), np.array([1.0, 0.0]), np.array([5.0, 5.0, 1.0]), np.array([0.0, 1.0]))
    samples = curve.sample(0.01)[0]
    np.testing.assert_allclose((samples[1] - samples[0]) / np.hypot(*(samples[1] - samples[0])), [1.0, 0.0], atol=0.01)
    np.testing.assert_allclose(samples[-1], [5.0, 5.0])


def test_parallel_lanes_are_one_road():
    features = built(
        ("left", straight(0, 50, 3.5), {"right_neighbors": ["right"]}),
        ("right", straight(0, 50, 0.0), {"left_neighbors": ["left"]}),
    )
    network = make_roads(features, Losses())
    (road,) = network.roads
    assert [features.ids[row] for row in road.lanes] == ["left", "right"]
    np.testing.assert_allclose(road.centres[1], -3.5, atol=1e-6)
    assert lane_width(road, 1, 0) == pytest.approx(3.5)
    np.testing.assert_allclose(lane_end(road, 1, -1)[0], [50.0, 0.0, 0.0], atol=1e-6)


def test_lanes_that_go_on_need_no_junction_and_forks_do():
    features = built(
        ("a", straight(0, 20, 0.0), {"exit_lanes": ["b"]}),
        ("b", straight(20, 40, 0.0), {"exit_lanes": ["c", "d"]}),
        ("c", straight(40, 60, 0.0), {}),
        ("d", [[40, 0, 0], [45, 0.2, 0], [60, 5, 0]], {"entry_lanes": ["b"]}),
    )
    network = make_roads(features, Losses())
    road = {features.ids[row]: network.roads[number] for row, (number, _) in network.place_of.items()}
    assert road["a"].end.road == road["b"].number
    assert road["b"].start.road == road["a"].number
    assert network.num_junctions == 1
    assert {connection.joint.other for connection in network.connections} == {road["c"].number, road["d"].number}
    for connection in network.connections:
        begin = network.roads[connection.road].curve.points
        np.testing.assert_allclose(begin[0], lane_end(road["b"], 0, -1)[0])
        assert np.hypot(*(begin[-1] - begin[0])[:2]) == pytest.approx(0.1, abs=0.01)


def test_what_cannot_be_a_road_is_reported():
    features = built(("a", straight(0, 20, 0.0), {"exit_lanes": ["elsewhere"]}), ("point", [[1.0, 1.0, 0.0]] * 2, {}))
    losses = Losses()
    make_roads(features, losses)
    assert {loss.what: loss.count for loss in losses.found()} == {
        "lanes without two points": 1,
        "links to lanes outside of the map": 1,
    }


def test_generated_maps_keep_every_lane_and_link(lake):
    for scenario in ScenarioLoader(lake):
        losses = Losses()
        network = make_roads(scenario.map, losses)
        assert len(network.place_of) == int(is_lane(scenario.map.feature_type).sum())
        links = sum(len(scenario.map.exit_lanes[row]) for row in network.place_of)
        going_on = sum(len(road.lanes) for road in network.roads if road.junction is None and road.end.road is not None)
        outside = sum(loss.count for loss in losses.found() if "outside" in loss.what)
        assert len(network.connections) + going_on == links - outside
        assert max((loss.error for loss in losses.found() if loss.what == "lane centres"), default=0.0) < 0.05
