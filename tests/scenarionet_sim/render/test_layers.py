"""What is painted: lines cut into dashes, double lines, crosswalks; boxes, trails and lights as artists."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgba

from scenarionet_data.vocabulary import MapFeatureType, is_road_edge, is_road_line
from scenarionet_sim.render import Moment, object_layer
from scenarionet_sim.render.map_layer import beside, dashes, lines_of, paint, zebra
from scenarionet_sim.render.palette import DASH, EGO, GAP, LIGHTS, LINE
from scenarionet_sim.roads.roads import Roads
from scenarionet_sim.worlds.world import World
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.scenarios import make_scenario
from tests.fixtures.simulations import generated


@settings(max_examples=40)
@given(st.integers(0, 10**6), st.integers(2, 30))
def test_dashes_lie_on_the_line_at_their_places(seed, count):
    line = np.cumsum(np.random.default_rng(seed).uniform(0.1, 6.0, (count, 2)), axis=0)
    whole = shapely.LineString(line)
    pieces = [shapely.LineString(piece) for piece in dashes(line)]
    assert len(pieces) == np.ceil(whole.length / (DASH + GAP))
    for number, piece in enumerate(pieces):
        first = number * (DASH + GAP)
        assert piece.length == pytest.approx(min(DASH, whole.length - first), abs=1e-9)
        assert whole.project(shapely.Point(piece.coords[0])) == pytest.approx(first, abs=1e-6)
        assert whole.buffer(1e-6).covers(piece)


def test_a_line_moved_to_its_left():
    line = np.array([[0.0, 0.0], [10.0, 0.0], [20.0, 0.0]])
    np.testing.assert_allclose(beside(line, 0.5), line + np.array([0, 0.5]))


@pytest.mark.parametrize(
    ("kind", "lefts", "num_pieces"),
    [
        ("SOLID_SINGLE_WHITE", [0.0], 1),
        ("BROKEN_SINGLE_YELLOW", [0.0], 2),
        ("SOLID_DOUBLE_YELLOW", [-LINE, LINE], 2),
        ("BROKEN_DOUBLE_YELLOW", [-LINE, LINE], 4),
        ("PASSING_DOUBLE_YELLOW", [-LINE, LINE], 3),
    ],
)
def test_every_kind_of_line_is_painted_as_it_is(kind, lefts, num_pieces):
    """15 m hold two dashes."""
    painted = paint(MapFeatureType[f"ROAD_LINE_{kind}"], np.array([[0.0, 0.0], [15.0, 0.0]]))
    assert len(painted) == num_pieces
    assert sorted({float(piece[0, 1]) for piece in painted}) == lefts


def test_zebra_stripes_cover_half_of_a_crosswalk_and_nothing_else():
    """12 m by 4 m, turned: stripes are as long as the crosswalk is broad."""
    turn = np.array([[np.cos(0.4), np.sin(0.4)], [-np.sin(0.4), np.cos(0.4)]])
    outline = np.array([[0, 0], [12, 0], [12, 4], [0, 4]]) @ turn
    stripes = [shapely.Polygon(stripe) for stripe in zebra(outline)]
    assert len(stripes) == 12
    together = shapely.unary_union(stripes)
    assert together.area == pytest.approx(24.0)
    assert shapely.Polygon(outline).buffer(1e-9).covers(together)
    for stripe in stripes:
        assert (stripe.area, stripe.length) == (pytest.approx(0.5 * 4), pytest.approx(2 * (0.5 + 4)))


def test_lines_are_put_together_again_from_segments():
    features = generated(3).map
    rows = [
        r
        for r, t in enumerate(features.types)
        if (is_road_line(t) or is_road_edge(t)) and len(features.polyline[r]) > 1
    ]
    found = list(lines_of(Roads.from_map(features)))
    assert [int(kind) for kind, _ in found] == features.types[rows].tolist()
    for (_, line), row in zip(found, rows, strict=True):
        np.testing.assert_array_equal(line, features.polyline[row][:, :2])


def test_trails_fade_and_skip_what_was_not_there():
    """The other car is seen from timestep 3 on; what stands still has no trail."""
    world = World.from_scenario(make_drive(others=(Other(20.0, 3.5, vx=5.0, first=3), Other(50.0))))
    moments = [Moment.recorded(world, timestep) for timestep in range(6)]
    (trail,) = object_layer.trails(world, moments, 1.0)
    assert isinstance(trail, LineCollection)
    assert len(trail.get_segments()) == 5 + 2
    alphas = [color[3] for color in trail.get_colors() if np.allclose(color[:3], to_rgba(EGO)[:3])]
    assert len(alphas) == 5
    assert np.all(np.diff(alphas) > 0)
    assert object_layer.trails(world, moments[:1], 1.0) == []


def test_boxes_are_there_for_who_is_present_with_the_ego_on_top():
    world = World.from_scenario(make_drive(others=(Other(20.0), Other(30.0, first=5))))
    others, _, ego, _ = object_layer.boxes(world, Moment.recorded(world, 0), 1.0)
    assert len(others.get_paths()) == 1
    assert len(ego.get_paths()) == 1
    assert ego.get_zorder() > others.get_zorder()
    np.testing.assert_allclose(ego.get_paths()[0].vertices[0], [2.3, 0.95], atol=1e-6)
    np.testing.assert_allclose(ego.get_facecolor()[0], to_rgba(EGO))


def test_lights_differ_in_colour_and_shape():
    assert len({shape for _, shape in LIGHTS.values()}) == len({fill for fill, _ in LIGHTS.values()}) == 4
    world = World.from_scenario(make_drive(red=True))
    drawn = [artist for artist in object_layer.lights(world, 0, 1.0) if len(artist.get_xdata())]
    assert [(artist.get_marker(), *artist.get_xydata()[0]) for artist in drawn] == [("s", 20.0, 0.0)]
    dark = World.from_scenario(make_scenario(0, num_lights=0))
    assert object_layer.lights(dark, 0, 1.0) == []
