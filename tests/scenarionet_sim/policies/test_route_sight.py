"""What an agent sees of the traffic on its route, and what the driver model would do there: single steps by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from scenarionet_data.errors import BadParameter
from scenarionet_sim.arrays.log import VX, Y, Z
from scenarionet_sim.policies.idm import Idm
from scenarionet_sim.policies.replay import Replay
from scenarionet_sim.policies.route_sight import Guidance, RouteTraffic
from scenarionet_sim.simulation.simulation import Simulation
from scenarionet_sim.worlds.world import World
from tests.fixtures.drives import Other, make_drive
from tests.scenarionet_sim.sensors.conformance import SensorConformance, simulation  # noqa: F401

LENGTH, WIDTH = 4.6, 1.9
"""Of every vehicle here [m]."""


def begin(**settings):
    """The ego at 10 m/s at the beginning of 40 m straight on, unless the settings say otherwise."""
    return Simulation([World.from_scenario(make_drive(**settings))])


class TestRouteTraffic(SensorConformance):
    sensor = RouteTraffic()

    def seen(self, drive, **settings):
        """In m/s, m, and for each object 1, m, m/s."""
        sensor = RouteTraffic(max_speed=50.0, **settings)
        scales = [50.0, sensor.range, *[1.0, sensor.range, 50.0] * sensor.objects]
        return self.observed(drive, sensor)[0] * scales

    def test_an_empty_route(self):
        drive = begin()
        for step in range(3):
            np.testing.assert_allclose(self.seen(drive), [10, 40 - step, 0, 0, 0, 0, 0, 0], atol=1e-4)
            drive.step([[0.0, 0.0]])

    def test_the_nearest_come_first_in_any_order_of_tracks(self):
        ahead = [Other(12.0, vx=5.0), Other(21.0, vx=-2.0), Other(30.0, vx=7.0)]
        gaps = [(1.0, other.x - LENGTH, other.vx) for other in ahead]
        for order in ([0, 1, 2], [2, 1, 0], [1, 2, 0]):
            drive = begin(others=tuple(ahead[k] for k in order))
            for objects in (1, 2, 4):
                found = self.seen(drive, objects=objects)[2:].reshape(objects, 3)
                wanted = np.array([*gaps, (0.0, 0.0, 0.0)])[:objects]
                np.testing.assert_allclose(found, wanted, atol=1e-4)

    def test_one_that_crosses_has_the_speed_along_the_route(self):
        drive = begin(others=(Other(15.0, -0.5, vx=3.0, vy=4.0),))  # its box is turned by the angle of (3, 4)
        turned = 0.5 * LENGTH * 0.6 + 0.5 * WIDTH * 0.8
        np.testing.assert_allclose(self.seen(drive)[2:5], [1, 15.0 - turned - 0.5 * LENGTH, 3], atol=1e-4)

    @pytest.mark.parametrize(("apart", "margin", "is_seen"), [(0.2, 0.3, True), (0.4, 0.3, False), (0.4, 0.5, True)])
    def test_the_margin_is_beside_the_agent(self, apart, margin, is_seen):
        drive = begin(others=(Other(20.0, WIDTH + apart, vx=5.0),))
        assert bool(self.seen(drive, margin=margin)[2]) == is_seen

    def test_what_is_behind_above_or_out_of_range_is_not_seen(self):
        drive = begin(others=(Other(-10.0, vx=5.0), Other(20.0, vx=5.0)))
        assert self.seen(drive, range=15.5)[2] == 1 and not self.seen(drive, range=15.3)[2:].any()
        drive.state.moment.motion[0, 2, Z] = 1.7  # higher than a vehicle
        assert not self.seen(drive)[2:].any()

    def test_an_agent_without_a_location_is_rejected(self):
        replayed = Simulation([World.from_scenario(make_drive())], (Replay(),))
        with pytest.raises(BadParameter, match="follow_paths"):
            self.observed(replayed, agents=np.array([[0, 0]], np.int32))

    def test_parameters_out_of_range(self):
        with pytest.raises(BadParameter, match="objects=0; expected a whole number of 1 or more"):
            RouteTraffic(objects=0)
        with pytest.raises(BadParameter, match="above 0"):
            RouteTraffic(range=0.0)


class TestGuidance(SensorConformance):
    sensor = Guidance()

    def throttle(self, drive, sensor=None, speed=None):
        if speed is not None:
            drive.state.moment.motion[0, 0, VX] = speed
        return self.observed(drive, sensor)[0, 1]

    def interacting(self, gap, closing):
        """Deceleration of the Intelligent Driver Model at 10 m/s."""
        return 2.0 * ((2.0 + 10.0 * 1.5 + 10.0 * closing / (2.0 * math.sqrt(6.0))) / gap) ** 2

    def test_a_free_road(self):
        assert self.throttle(begin()) == pytest.approx(0.0, abs=1e-6)  # 10 m/s is its cruising speed
        assert self.throttle(begin(), speed=5.0) == pytest.approx(2.0 * (1.0 - 0.5**4) / 4.0, abs=1e-6)

    def test_a_leader(self):
        drive = begin(others=(Other(30.0, vx=5.0),))
        wanted = -self.interacting(30.0 - LENGTH, closing=5.0) / 8.0
        assert self.throttle(drive) == pytest.approx(wanted, abs=1e-5)

    def test_an_obstacle_too_near_is_braked_for_as_hard_as_the_model_may(self):
        drive = begin(others=(Other(8.0),))
        assert self.throttle(drive, Guidance(law=Idm(hardest=6.0))) == pytest.approx(-6.0 / 8.0)

    @pytest.mark.parametrize(("apart", "law", "brakes"), [(0.2, None, True), (0.4, None, False), (0.2, Idm(), False)])
    def test_it_keeps_from_what_is_beside_the_way(self, apart, law, brakes):
        drive = begin(others=(Other(20.0, WIDTH + apart, vx=5.0),))
        assert (self.throttle(drive, Guidance(law=law) if law else None) < -0.1) == brakes

    def test_a_red_light(self):
        """At the middle of the way."""
        wanted = -self.interacting(40.0 - 0.5 * LENGTH, closing=10.0) / 8.0
        assert self.throttle(begin(red=True, num_steps=81)) == pytest.approx(wanted, abs=1e-5)

    @pytest.mark.parametrize(
        ("left", "speed", "wanted"),
        [
            (25.3, 10.0, -2.0 / 8.0),  # the speed from which 2 m/s² end 0.3 m before the end
            (25.3, 10.2, -2.4 / 8.0),  # 0.2 m/s too much, in half a second
            (25.3, 9.8, -1.6 / 8.0),
            (5.0, 10.0, -1.0),
            (0.2, 0.0, -2.0 / 8.0),
        ],
    )
    def test_the_end_of_the_route(self, left, speed, wanted):
        drive = begin(speed=left / 2.0, num_steps=21)
        law = Guidance(law=Idm(slowest=100.0, acceleration=100.0, lateral=100.0))
        assert self.throttle(drive, law, speed) == pytest.approx(wanted, abs=1e-4)

    def test_pure_pursuit(self):
        drive = begin()
        assert self.observed(drive)[0, 0] == 0.0
        drive.state.moment.motion[0, 0, Y] = 1.0  # to the left of its way
        wheelbase = 0.6 * LENGTH
        to_point = 0.5 * 10.0 + 0.5 * wheelbase, -1.0  # from the rear axle
        angle = math.atan(2.0 * wheelbase * to_point[1] / math.hypot(*to_point) ** 2)
        assert self.observed(drive)[0, 0] == pytest.approx(angle / math.radians(40.0), abs=1e-6)
        drive.state.moment.motion[0, 0, VX] = 2.0  # at least 3 m ahead
        to_point = 3.0 + 0.5 * wheelbase, -1.0
        angle = math.atan(2.0 * wheelbase * to_point[1] / math.hypot(*to_point) ** 2)
        assert self.observed(drive)[0, 0] == pytest.approx(angle / math.radians(40.0), abs=1e-6)

    def test_driven_by_it_a_vehicle_stops_softly_before_the_end(self):
        drive = begin(speed=12.0, num_steps=61)
        speeds = []
        for _ in range(120):
            drive.step(self.observed(drive))
            speeds.append(drive.state.motion[0, 0, VX])
        assert speeds[-1] == 0.0 and 72.0 - drive.state.arc[0, 0] == pytest.approx(0.3, abs=0.15)
        assert np.diff(speeds).min() > -0.25  # 2.5 m/s²

    def test_an_agent_without_a_location_is_rejected(self):
        replayed = Simulation([World.from_scenario(make_drive())], (Replay(),))
        with pytest.raises(BadParameter, match="follow_paths"):
            self.observed(replayed, agents=np.array([[0, 0]], np.int32))
