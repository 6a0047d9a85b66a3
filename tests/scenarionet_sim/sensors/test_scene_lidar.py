"""Lidars in the scene of cameras against the boxes and the plane of :class:`PointCloud`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scenarionet_data.errors import BadParameter
from scenarionet_sim.sensors.camera import Mount
from scenarionet_sim.sensors.lidar_presets import HDL_32E, PANDAR_64
from scenarionet_sim.sensors.point_cloud import PointCloud
from scenarionet_sim.sensors.scene_lidar import SceneLidar
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.simulations import simulate
from tests.scenarionet_sim.sensors.conformance import SensorConformance, simulation  # noqa: F401

RINGS = PointCloud(rings=24, azimuths=360, range=60.0, lowest=-0.4, highest=0.1, mount=1.8)
BARE = SceneLidar(
    tuple(RINGS.elevations[::-1].tolist()), 360, 60.0, Mount(x=0.0, z=1.8), are_boxes=True, has_scenery=False
)
ME = np.array([[0, 0]], np.int32)


class TestSceneLidar(SensorConformance):
    sensor = replace(BARE, elevations=(0.0, -0.1, -0.3), azimuths=64, noise=0.1, dropout=0.05)


@pytest.fixture(scope="module")
def drive():
    others = (Other(14.0, 1.0, vx=6.0), Other(22.0, -3.0, vx=3.0, vy=1.0), Other(9.0, 4.5), Other(-9.0, 0.5))
    return simulate(make_drive(speed=8.0, others=others), steps=3)


def observed(sensor, drive, seed=0):
    return sensor.observe(drive.batch, drive.state, ME, np.random.default_rng(seed), sensor.empty(1))[0]


def test_ranges_are_those_of_boxes_and_plane(drive):
    found = observed(BARE, drive)
    expected = observed(RINGS, drive)[::-1]
    same = np.abs(found[..., 0] - expected) * 60.0 < 2e-3
    assert same.mean() > 0.995  # rays through an edge
    assert 0.3 < (found[..., 0] < 1).mean() < 0.99
    hits = BARE.points(found)
    assert len(hits) == (found[..., 0] < 1).sum()
    assert np.abs(hits[:, 2] + 1.8).min() < 1e-3
    assert ((hits[:, 3] > 0) & (hits[:, 3] <= 1)).mean() > 0.95


def test_boxes_right_beside_the_lidar_are_seen_whole():
    """Their faces extend over more than a right angle, and behind the first azimuth."""
    near = simulate(make_drive(speed=8.0, others=(Other(0.5, 2.3), Other(5.2, 0.3), Other(-0.5, -2.4))), steps=1)
    found = observed(replace(BARE, mount=Mount(x=0.0, z=0.9)), near)
    expected = observed(replace(RINGS, mount=0.9), near)[::-1]
    assert (expected * 60.0 < 2.0).mean() > 0.1
    assert (np.abs(found[..., 0] - expected) * 60.0 < 2e-3).mean() > 0.99  # rays through an edge


def test_dropout_and_threads(drive):
    whole = observed(BARE, drive)
    np.testing.assert_array_equal(whole, observed(replace(BARE, threads=3), drive))
    thin = observed(replace(BARE, dropout=0.25), drive)
    lost = (whole[..., 0] < 1) & (thin[..., 0] == 1)
    assert lost.sum() / (whole[..., 0] < 1).sum() == pytest.approx(0.25, abs=0.03)
    assert (thin[..., 1][lost] == 0).all()


def test_presets_have_the_rings_of_the_data_sheets():
    assert HDL_32E.shape == (32, 1085, 2)
    assert PANDAR_64.shape == (64, 1800, 2)
    steps = -np.diff(np.rad2deg(PANDAR_64.elevations))
    assert np.isclose(steps, 1 / 6, atol=0.01).sum() == 48
    np.testing.assert_allclose(-np.diff(np.rad2deg(HDL_32E.elevations)), 1.3335, atol=1e-3)


@pytest.mark.parametrize("wrong", [{"elevations": ()}, {"elevations": (0.0, 0.1)}, {"azimuths": 0}, {"range": 0.0}])
def test_bad_lidars_are_refused(wrong):
    with pytest.raises(BadParameter, match=rf"lidar|{next(iter(wrong))}=0.*expected"):
        replace(BARE, **wrong)
