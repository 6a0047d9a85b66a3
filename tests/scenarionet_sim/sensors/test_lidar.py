"""The lidar, against shapely."""

from __future__ import annotations

import sys

import numpy as np
import pytest
import shapely

from scenarionet_data.errors import BadParameter, MissingDependency
from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_sim.sensors.lidar import Lidar
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.simulations import simulate
from tests.scenarionet_sim.sensors import oracle
from tests.scenarionet_sim.sensors.conformance import SensorConformance, simulation  # noqa: F401


class TestLidar(SensorConformance):
    sensor = Lidar(rays=90, noise=0.5, dropout=0.1)

    def test_matches_shapely(self, simulation):  # noqa: F811
        rays, reach, state = 61, 40.0, simulation.state
        agents = simulation.agents[::4].copy()
        found = self.observed(simulation, Lidar(rays, reach), agents)
        num_inside = 0
        for (world, row), shares in zip(agents, found, strict=True):
            shapes = [oracle.box(state, world, n) for n in oracle.others(state, world, row)]
            num_inside += any(shape.contains(shapely.Point(state.position[world, row])) for shape in shapes)
            wanted = [
                oracle.seen(oracle.ray(state, world, row, 2 * np.pi * k / rays, reach), shapes, reach)
                for k in range(rays)
            ]
            np.testing.assert_allclose(shares, wanted, atol=1e-7)
        assert (found < 1).mean() > 0.1

    def test_noise_changes_observations_within_their_range(self, simulation):  # noqa: F811
        exact = self.observed(simulation, Lidar(rays=90))
        noisy = self.observed(simulation, Lidar(rays=90, noise=0.5))
        seen = exact < 0.9
        assert np.std((noisy - exact)[seen] * 50) == pytest.approx(0.5, rel=0.15)
        dropped = self.observed(simulation, Lidar(rays=90, dropout=0.25))
        assert (dropped[seen] == 1).mean() == pytest.approx(0.25, abs=0.06)


def test_car_ahead_is_detected():
    """A car 20 m ahead: the range is 20 m minus half its length, and the ego's own box is ignored."""
    drive = simulate(make_drive(speed=0.0, others=(Other(20.0),)), steps=0)
    lidar = Lidar(rays=4, range=50.0)
    shares = lidar.observe(drive.batch, drive.state, drive.agents, np.random.default_rng(0), lidar.empty(2))
    np.testing.assert_allclose(shares, [[(20 - 2.3) / 50, 1, 1, 1], [1, 1, (20 - 2.3) / 50, 1]], atol=1e-7)


def test_object_types_are_distinguished():
    drive = simulate(make_drive(speed=0.0, others=(Other(20.0), Other(10.0, type=ObjectType.PEDESTRIAN))), steps=0)
    ego = np.array([[0, 0]], np.int32)
    seen = {}
    for kind in (ObjectType.VEHICLE, ObjectType.PEDESTRIAN, ObjectType.CYCLIST):
        lidar = Lidar(rays=8, types=(kind,))
        seen[kind] = lidar.observe(drive.batch, drive.state, ego, np.random.default_rng(0), lidar.empty(1))[0, 0] * 50
    np.testing.assert_allclose(list(seen.values()), [17.7, 9.7, 50.0], atol=1e-5)


def test_space_without_gymnasium_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "gymnasium.spaces", None)
    with pytest.raises(MissingDependency, match=r"scenarionet-lake\[sim\]"):
        Lidar().space()


@pytest.mark.parametrize("wrong", [{"rays": 0}, {"range": 0.0}, {"noise": -1.0}, {"dropout": 1.5}])
def test_parameters_out_of_range(wrong):
    with pytest.raises(BadParameter, match=next(iter(wrong))):
        Lidar(**wrong)
