"""People on foot, cyclists and parked cars of generated traffic: where they are, and what they wait for."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
import shapely

from scenarionet_data.converters.pg import Procedural, ProceduralOptions
from scenarionet_data.errors import BadParameter
from scenarionet_data.procedural.generate import generate
from scenarionet_data.procedural.options import GeneratorOptions
from scenarionet_data.procedural.right_of_way import STOP
from scenarionet_data.scenario.vocabulary import MapFeatureType, ObjectType
from tests.scenarionet_data.procedural.test_traffic import touches

BUSY = GeneratorOptions(
    pedestrians=3.0, cyclists=0.3, parking=1.0, blocks="intersection=1 t_intersection=1", num_blocks=1, max_steps=250,
    lights=0.6,
)  # fmt: skip


@lru_cache
def busy(seed):
    return generate(seed, BUSY)


def on_foot(episode):
    return [row for row, kind in enumerate(episode.population.kinds) if kind == "pedestrian"]


def crosswalks(episode):
    """Outline of each, and the lanes that begin at it."""
    return [
        (shapely.Polygon(area.outline), area.controlled_lanes)
        for block in episode.road_map.blocks
        for area in block.areas
        if area.type == MapFeatureType.CROSSWALK
    ]


@pytest.mark.parametrize("seed", range(4))
def test_people_are_beside_roads_or_on_crosswalks(seed):
    episode = busy(seed)
    roads = shapely.unary_union([shape for block in episode.road_map.blocks for shape in block.footprint])
    walks = shapely.unary_union([shape for shape, _ in crosswalks(episode)]).buffer(0.2)
    forbidden = roads.difference(walks)
    for row in on_foot(episode):
        points = episode.motion[row, episode.valid[row], :2]
        assert not shapely.contains_xy(forbidden, *points.T).any()


def test_people_cross_only_while_the_vehicles_of_that_side_have_red():
    crossings = 0
    for seed in range(4):
        episode = busy(seed)
        number = {lane.id: row for row, lane in enumerate(episode.road_map.lanes)}
        for shape, lanes in crosswalks(episode):
            signals = {int(episode.graph.lanes.signal[number[lane]]) for lane in lanes} - {-1}
            for row in on_foot(episode):
                inside = (
                    shapely.contains_xy(shape, *np.moveaxis(episode.motion[row, :, :2], -1, 0)) & episode.valid[row]
                )
                crossings += inside.any()
                assert all((episode.lights[signal, inside] == STOP).all() for signal in signals)
    assert crossings > 3


@pytest.mark.integration
def test_drivers_and_people_keep_apart():
    episodes = [busy(seed) for seed in range(4)]
    assert not any(touches(episode) for episode in episodes)
    kinds = {kind for episode in episodes for kind in episode.population.kinds}
    assert kinds >= {"car", "van", "cyclist", "pedestrian"}


def test_every_class_of_vehicle_has_its_size():
    episodes = [generate(seed, GeneratorOptions(density=6.0, max_steps=100)) for seed in range(3)]
    lengths = {}
    for episode in episodes:
        for kind, size in zip(episode.population.kinds, episode.population.size, strict=True):
            lengths.setdefault(kind, []).append(size[0])
    means = {kind: np.mean(lengths[kind]) for kind in ("cyclist", "motorcycle", "car", "van", "truck", "bus")}
    assert list(means) == sorted(means, key=means.get)


def test_people_stop_at_the_kerb_and_hurry_nowhere():
    stopped = 0
    for seed in range(4):
        episode = busy(seed)
        speeds = [episode.motion[row, episode.valid[row], 3] for row in on_foot(episode)]
        assert all(speed.max() <= 2.2 for speed in speeds)
        assert all(np.abs(np.diff(speed)).max(initial=0.0) <= 0.3 + 1e-9 for speed in speeds)
        stopped += sum((speed < 0.05).any() for speed in speeds)
    assert stopped > 2


def test_cyclists_keep_right_and_are_slow():
    found = 0
    for seed in range(4):
        episode = busy(seed)
        for row, kind in enumerate(episode.population.kinds):
            if kind == "cyclist":
                found += 1
                assert episode.motion[row, episode.valid[row], 3].max() <= 6.5 + 1e-9
                assert episode.population.vehicles.aside[row] < -0.5
    assert found > 3


@pytest.mark.parametrize("seed", range(4))
def test_parked_cars_are_in_bays_outside_of_the_lanes(seed):
    episode = busy(seed)
    bays = [
        shapely.Polygon(area.outline)
        for block in episode.road_map.blocks
        for area in block.areas
        if area.type == MapFeatureType.CARPARK_AREA
    ]
    lanes = shapely.unary_union([shape for block in episode.road_map.blocks for shape in block.footprint])
    edges = shapely.unary_union(
        [
            shapely.LineString(line.points)
            for block in episode.road_map.blocks
            for line in block.lines
            if line.type == MapFeatureType.ROAD_EDGE_BOUNDARY
        ]
    )
    for obstacle in episode.obstacles:
        if obstacle.word == "parked car":
            c, s = np.cos(obstacle.heading), np.sin(obstacle.heading)
            corners = [
                (obstacle.x + c * a * obstacle.size[0] / 2 - s * b * obstacle.size[1] / 2,
                 obstacle.y + s * a * obstacle.size[0] / 2 + c * b * obstacle.size[1] / 2)
                for a, b in ((1, 1), (-1, 1), (-1, -1), (1, -1))
            ]  # fmt: skip
            body = shapely.Polygon(corners)
            assert any(bay.buffer(0.15).contains(body) for bay in bays)
            assert body.intersection(lanes).area < 0.05
            assert not body.buffer(-0.15).intersects(edges), "in a wall"


def test_the_lake_has_their_types():
    options = ProceduralOptions(pedestrians=3.0, cyclists=0.3, parking=1.0, blocks="intersection=1")
    (shard,) = Procedural().shards("1:2", "train", "v2", options)
    tracks = Procedural().scenario(shard, 1).tracks
    assert {ObjectType.PEDESTRIAN, ObjectType.CYCLIST, ObjectType.VEHICLE} <= set(tracks.object_type.tolist())
    sizes = tracks.size[tracks.object_type == ObjectType.PEDESTRIAN]
    assert (sizes.max(axis=-1) < 2.0).all()


def test_nobody_walks_or_parks_where_the_options_say_so():
    episode = generate(1, GeneratorOptions(pedestrians=0.0, cyclists=0.0, parking=0.0, construction=0.0))
    assert not {"pedestrian", "cyclist"} & set(episode.population.kinds)
    assert not episode.obstacles


@pytest.mark.parametrize("options", [{"pedestrians": -1.0}, {"cyclists": 2.0}, {"parking": 1.5}])
def test_options_outside_their_range_are_named(options):
    with pytest.raises(BadParameter, match=next(iter(options))):
        GeneratorOptions(**options).check()
