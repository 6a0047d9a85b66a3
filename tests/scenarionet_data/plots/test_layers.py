"""Drawing of map layers: dashed and double lines, crosswalks; boxes, trails and lights as artists."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgba

from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.plots import Scene, object_layer
from scenarionet_data.plots.paint import arrows, beside, dashes, paint, zebra
from scenarionet_data.plots.palette import DASH, EGO, GAP, LIGHTS, LINE
from scenarionet_data.scenario.vocabulary import MapFeatureType
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.scenarios import make_scenario


def lists(points):
    return Ragged.from_flat([len(each) for each in points], np.concatenate(points))


@given(st.integers(0, 10**6), st.integers(2, 30))
def test_dashes_are_on_their_line_at_regular_positions(seed, count):
    """Of two lines, next to an empty one and a single point."""
    line = np.cumsum(np.random.default_rng(seed).uniform(0.1, 6.0, (count, 2)), axis=0)
    found = list(dashes(lists([line, np.zeros((0, 2)), line[:1], line + 100.0])))
    for whole in (shapely.LineString(line), shapely.LineString(line + 100.0)):
        number_of_dashes = int(np.ceil(whole.length / (DASH + GAP)))
        pieces, found = [shapely.LineString(piece) for piece in found[:number_of_dashes]], found[number_of_dashes:]
        for number, piece in enumerate(pieces):
            first = number * (DASH + GAP)
            assert piece.length == pytest.approx(min(DASH, whole.length - first), abs=1e-9)
            assert whole.project(shapely.Point(piece.coords[0])) == pytest.approx(first, abs=1e-6)
            assert whole.buffer(1e-6).covers(piece)
    assert found == []


def test_line_offset_to_the_left():
    line = np.array([[0.0, 0.0], [10.0, 0.0], [20.0, 0.0]])
    both = beside(lists([line, -line]), 0.5)
    np.testing.assert_allclose(both[0], line + np.array([0, 0.5]))
    np.testing.assert_allclose(both[1], -line - np.array([0, 0.5]))


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
def test_every_line_type_is_drawn_in_its_style(kind, lefts, num_pieces):
    """15 m hold two dashes."""
    strokes = paint(MapFeatureType[f"ROAD_LINE_{kind}"], lists([np.array([[0.0, 0.0], [15.0, 0.0]])]))
    painted = [piece for stroke in strokes for piece in stroke]
    assert len(painted) == num_pieces
    assert sorted({float(piece[0, 1]) for piece in painted}) == lefts


def test_zebra_stripes_cover_half_of_a_crosswalk():
    """12 m by 4 m, rotated: stripes are as long as the crosswalk is wide."""
    turn = np.array([[np.cos(0.4), np.sin(0.4)], [-np.sin(0.4), np.cos(0.4)]])
    outline = np.array([[0, 0], [12, 0], [12, 4], [0, 4]]) @ turn
    stripes = [shapely.Polygon(stripe) for stripe in zebra(outline)]
    assert len(stripes) == 12
    together = shapely.unary_union(stripes)
    assert together.area == pytest.approx(24.0)
    assert shapely.Polygon(outline).buffer(1e-9).covers(together)
    for stripe in stripes:
        assert (stripe.area, stripe.length) == (pytest.approx(0.5 * 4), pytest.approx(2 * (0.5 + 4)))


def test_arrows_point_along_straight_lanes():
    """30 m apart on a long lane, one on a short lane, none on the shortest, on a turn and on a single point."""
    angle = np.linspace(0, np.pi / 2, 20)
    turn = 15 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    lanes = [[[0, 0], [95, 0]], [[0, 9], [0, -9]], [[0, 0], [8, 0]], turn, [[5, 5]]]
    found = np.array(list(arrows(lists([np.array(lane, float) for lane in lanes]))))
    np.testing.assert_allclose(found.mean(axis=1)[:3, 0], np.array([1, 3, 5]) * 95 / 6, atol=0.5)
    along = found[:, 0] - found[:, 1:].mean(axis=1)
    np.testing.assert_allclose(along / np.hypot(*along.T)[:, None], [[1, 0]] * 3 + [[0, -1]], atol=1e-9)
    assert arrows(Ragged.empty(2, 2)).lengths.tolist() == []


def test_trails_fade_and_skip_missing_positions():
    """The other car is visible from timestep 3 on; stationary objects have no trail."""
    scene = Scene.of(make_drive(others=(Other(20.0, 3.5, vx=5.0, first=3), Other(50.0))))
    moments = [scene.moment(timestep) for timestep in range(6)]
    (trail,) = object_layer.trails(scene, moments)
    assert isinstance(trail, LineCollection)
    assert len(trail.get_segments()) == 5 + 2
    alphas = [color[3] for color in trail.get_colors() if np.allclose(color[:3], to_rgba(EGO)[:3])]
    assert len(alphas) == 5
    assert np.all(np.diff(alphas) > 0)
    assert object_layer.trails(scene, moments[:1]) == []


def test_boxes_of_present_objects_with_the_ego_on_top():
    scene = Scene.of(make_drive(others=(Other(20.0), Other(30.0, first=5))))
    others, _, ego, _ = object_layer.boxes(scene, scene.moment(0))
    assert len(others.get_paths()) == 1
    assert len(ego.get_paths()) == 1
    assert ego.get_zorder() > others.get_zorder()
    np.testing.assert_allclose(ego.get_paths()[0].vertices[0], [2.3, 0.95], atol=1e-6)
    np.testing.assert_allclose(ego.get_facecolor()[0], to_rgba(EGO))


def test_lights_differ_in_colour_and_shape():
    assert len({shape for _, shape in LIGHTS.values()}) == len({fill for fill, _ in LIGHTS.values()}) == 4
    scene = Scene.of(make_drive(red=True))
    drawn = [artist for artist in object_layer.lights(scene, 0) if len(artist.get_xdata())]
    assert [(artist.get_marker(), *artist.get_xydata()[0]) for artist in drawn] == [("s", 20.0, 0.0)]
    dark = Scene.of(make_scenario(0, num_lights=0))
    assert object_layer.lights(dark, 0) == []
