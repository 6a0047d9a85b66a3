"""The order of a polygon's vertices, clockwise or not, changes no area, picture, observation or metric."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.building import MapBuilder
from scenarionet_data.plots.map_layer import map_artists
from scenarionet_data.plots.shapes import MapShapes
from scenarionet_data.scenario.description import MapFeatures
from scenarionet_data.scenario.vocabulary import MapFeatureType
from scenarionet_sim.metrics.road import is_off_road
from scenarionet_sim.roads.roads import Roads
from scenarionet_sim.sensors.bird_view import BirdView
from tests.fixtures.simulations import generated, simulate

SIDE = 60.0
"""Side of the square with all polygons [m]."""

KINDS = (
    MapFeatureType.LANE_SURFACE_STREET,
    MapFeatureType.DRIVABLE_AREA,
    MapFeatureType.INTERSECTION,
    MapFeatureType.CROSSWALK,
    MapFeatureType.DRIVEWAY,
)


@st.composite
def maps(draw: st.DrawFn) -> MapFeatures:
    """Overlapping star-shaped polygons, convex or not, of random orientation."""
    builder = MapBuilder()
    for number in range(draw(st.integers(1, 8))):
        rng = np.random.default_rng(draw(st.integers(0, 10**6)))
        angle = np.sort(rng.uniform(0, 2 * np.pi, rng.integers(3, 12)))
        ray = rng.uniform(2, SIDE / 3, len(angle))
        points = rng.uniform(0.3 * SIDE, 0.7 * SIDE, 2) + ray[:, None] * np.stack([np.cos(angle), np.sin(angle)], 1)
        outline = np.column_stack([points, np.zeros(len(points))])
        kind = draw(st.sampled_from(KINDS))
        line = {"polyline": outline[:2]} if kind == MapFeatureType.LANE_SURFACE_STREET else {}
        builder.add(f"f{number}", kind, polygon=outline[:: draw(st.sampled_from([1, -1]))], **line)
    return builder.build(np.zeros(3))


def reverse(features: MapFeatures, is_reversed: list[bool]) -> MapFeatures:
    """Reverse the order of the vertices of some polygons."""
    outlines = [
        outline[::-1] if turn else outline for outline, turn in zip(features.polygon, is_reversed, strict=False)
    ]
    return replace(features, polygon=Ragged.from_lists(outlines, 3))


def drawn(features: MapFeatures) -> np.ndarray:
    """The road surfaces as pictures have them."""
    figure = Figure(figsize=(2, 2), dpi=60)
    canvas = FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(0, SIDE), ylim=(0, SIDE))
    for artist in map_artists(MapShapes.from_map(features)):
        axes.add_artist(artist)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba()).astype(int)


@given(maps(), st.lists(st.booleans(), min_size=8, max_size=8), st.integers(0, 10**6))
def test_areas_and_off_road_are_unchanged(features, is_reversed, seed):
    points = np.random.default_rng(seed).uniform(0, SIDE, (200, 2))
    before, after = Roads.from_map(features), Roads.from_map(reverse(features, is_reversed))
    np.testing.assert_array_equal(before.is_on_road(points), after.is_on_road(points))
    np.testing.assert_array_equal(before.lane_at(points), after.lane_at(points))
    for kind in KINDS:
        selected = before.polygon_type == kind
        np.testing.assert_array_equal(before.is_in(points, selected), after.is_in(points, selected))
    corners = points.reshape(50, 4, 2)
    if before.is_road.any():
        np.testing.assert_array_equal(is_off_road(corners, before), is_off_road(corners, after))


@pytest.mark.long
@settings(max_examples=20)
@given(maps(), st.lists(st.booleans(), min_size=8, max_size=8))
def test_pictures_are_unchanged(features, is_reversed):
    before, after = drawn(features), drawn(reverse(features, is_reversed))
    # The renderer rounds edges that it draws in the other direction differently, by a few of 255 levels.
    assert np.abs(before - after).max() <= 8
    assert (np.abs(before - after) > 2).mean() < 0.01


@pytest.mark.parametrize("seed", [0, 1])
def test_bird_views_are_unchanged(seed):
    scenario = generated(3)
    turns = (np.random.default_rng(seed).random(len(scenario.map)) < 0.5).tolist()
    turned = replace(scenario, map=reverse(scenario.map, turns))
    assert not turned.map.polygon.is_equal(scenario.map.polygon)
    sensor = BirdView(size=64, resolution=0.5)
    found = []
    for each in (scenario, turned):
        simulation = simulate(each, steps=0)
        out = np.zeros((len(simulation.agents), *sensor.shape), sensor.dtype)
        found.append(
            sensor.observe(simulation.batch, simulation.state, simulation.agents, np.random.default_rng(0), out)
        )
    np.testing.assert_array_equal(*found)
    assert found[0].any()
