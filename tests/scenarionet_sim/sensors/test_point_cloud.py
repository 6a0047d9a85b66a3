"""The point cloud, against brute-force rays in 3D."""

from __future__ import annotations

import numpy as np

from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_sim.sensors.base import directions
from scenarionet_sim.sensors.point_cloud import PointCloud
from scenarionet_sim.sensors.point_cloud_kernels import spin
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.simulations import simulate
from tests.scenarionet_sim.sensors import oracle
from tests.scenarionet_sim.sensors.conformance import SensorConformance, simulation  # noqa: F401


class TestPointCloud(SensorConformance):
    sensor = PointCloud(rings=8, azimuths=64, noise=0.1, dropout=0.1)

    def test_point_cloud_matches_brute_force(self, simulation):  # noqa: F811
        sensor, state = PointCloud(rings=7, azimuths=48, lowest=-0.3, highest=0.1, mount=1.2), simulation.state
        agents = simulation.agents[::5].copy()
        found = np.empty((len(agents), *sensor.shape))
        slopes, ground = np.tan(sensor.elevations), np.ones(sensor.rings)
        down = slopes < 0
        ground[down] = np.minimum(-sensor.mount / np.sin(sensor.elevations[down]) / sensor.range, 1)
        rays = directions(sensor.azimuths), np.column_stack([slopes, ground]), (sensor.mount, sensor.range)
        spin(agents, state.motion, state.size, state.present, *rays, found)
        for (world, row), shares in zip(agents, found, strict=True):
            np.testing.assert_allclose(shares, slabs(sensor, state, world, row), atol=1e-9)
        above = found[:, sensor.elevations >= 0]
        assert (above < 1).any()


def slabs(sensor, state, world, row):
    """Ranges as fractions: where each ray first enters a box (slabs in three dimensions), or the ground."""
    flat = np.arange(sensor.azimuths) * 2 * np.pi / sensor.azimuths + state.heading[world, row]
    up = sensor.elevations[:, None]
    way = np.stack([np.cos(up) * np.cos(flat), np.cos(up) * np.sin(flat), np.sin(up) + 0 * flat], axis=-1)
    ground = state.z[world, row] - state.size[world, row, 2] / 2
    eye = np.array([*state.position[world, row], ground + sensor.mount])
    with np.errstate(divide="ignore"):
        best = np.where(way[..., 2] < 0, sensor.mount / -way[..., 2], np.inf)
    for n in oracle.others(state, world, row):
        cos, sin = np.cos(state.heading[world, n]), np.sin(state.heading[world, n])
        turn = np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])
        start = turn @ (eye - [*state.position[world, n], state.z[world, n]])
        along = way @ turn.T
        half = state.size[world, n] / 2
        with np.errstate(divide="ignore", invalid="ignore"):
            first, second = (-half - start) / along, (half - start) / along
        enter, leave = np.minimum(first, second).max(axis=-1), np.maximum(first, second).min(axis=-1)
        hit = (enter <= leave) & (leave >= 0)
        best = np.where(hit, np.minimum(best, np.maximum(enter, 0)), best)
    return np.minimum(best / sensor.range, 1)


def test_points_are_on_visible_surfaces():
    """On the ground, ``mount`` below the sensor, or on the back of the car ahead."""
    drive = simulate(make_drive(speed=0.0, others=(Other(20.0),)), steps=0)
    sensor = PointCloud(rings=32, azimuths=360)
    ego = np.array([[0, 0]], np.int32)
    observed = sensor.observe(drive.batch, drive.state, ego, np.random.default_rng(0), sensor.empty(1))[0]
    points = sensor.points(observed)
    on_ground = np.abs(points[:, 2] + sensor.mount) < 1e-4
    on_car = np.abs(points[:, 0] - 17.7) < 1e-4
    assert (on_ground | on_car).all()
    assert on_car.sum() > 20
    assert np.abs(points[on_car, 1]).max() < 0.95
    only_cars = PointCloud(rings=32, azimuths=360, types=(ObjectType.VEHICLE,))
    observed = only_cars.observe(drive.batch, drive.state, ego, np.random.default_rng(0), only_cars.empty(1))[0]
    assert (observed < 1).sum() == on_car.sum()
