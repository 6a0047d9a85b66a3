"""Observation of the ego, its route, lights and other objects, against NumPy and shapely."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from scenarionet_data.arrays.geometry import wrap_angle
from scenarionet_data.errors import BadParameter
from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_sim.policies.replay import Replay
from scenarionet_sim.sensors.navigation import LightAhead, Navigation
from scenarionet_sim.sensors.state import EgoState
from scenarionet_sim.sensors.surrounding import Surrounding
from scenarionet_sim.simulation.simulation import Simulation
from scenarionet_sim.worlds.world import World
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.simulations import simulate
from tests.scenarionet_sim.sensors import oracle
from tests.scenarionet_sim.sensors.conformance import SensorConformance, simulation  # noqa: F401


def path_of(batch, world, row):
    paths = batch.worlds[world].paths
    first, end = paths.path_offsets[row : row + 2]
    return paths.path[first:end, :2].astype(float)


class TestEgoState(SensorConformance):
    sensor = EgoState()

    def test_matches_numpy(self, simulation):  # noqa: F811
        state, batch = simulation.state, simulation.batch
        found = self.observed(simulation)
        for (world, row), observed in zip(simulation.agents, found, strict=True):
            heading, path = state.heading[world, row], path_of(batch, world, row)
            forward, left = oracle.in_frame(state, world, row, state.position[world, row] + state.velocity[world, row])
            rate, length = state.yaw_rate[world, row], state.size[world, row, 0]
            steering = np.arctan(0.6 * length * rate / forward) if abs(forward) >= 0.1 else 0.0
            along, turn, done = state.arc[world, row], 0.0, 1.0
            if len(path) > 1:
                arcs = np.append(0, np.cumsum(np.hypot(*np.diff(path, axis=0).T)))
                k = np.clip(np.searchsorted(arcs, along, "right") - 1, 0, len(path) - 2)
                turn = wrap_angle(heading - np.arctan2(*(path[k + 1] - path[k])[::-1]))
                done = np.clip(along / arcs[-1], 0, 1)
            wanted = [forward / 40, left / 40, rate / 2, steering / (np.pi / 2), turn / np.pi]
            wanted += [state.lateral[world, row] / 10, done]
            np.testing.assert_allclose(observed, np.clip(wanted, -1, 1), atol=2e-6)

    def test_unlocated_object_is_rejected(self):
        replayed = Simulation([World.from_scenario(make_drive())], (Replay(),))
        with pytest.raises(BadParameter, match="follow_paths"):
            self.observed(replayed, agents=np.array([[0, 0]], np.int32))


class TestNavigation(SensorConformance):
    sensor = Navigation()

    def test_matches_shapely(self, simulation):  # noqa: F811
        state, batch = simulation.state, simulation.batch
        found = self.observed(simulation)
        for (world, row), observed in zip(simulation.agents, found, strict=True):
            points = path_of(batch, world, row)
            path = shapely.LineString(points) if len(points) > 1 else shapely.Point(points[0])
            arcs = state.arc[world, row] + 2.0 * np.arange(1, 11)
            places = [path if len(points) == 1 else path.interpolate(max(arc, 0.0)) for arc in arcs]
            wanted = oracle.in_frame(state, world, row, [[place.x, place.y] for place in places])
            np.testing.assert_allclose(observed, np.clip(wanted / 25, -1, 1), atol=2e-5)

    def test_points_are_straight_ahead_and_end_at_the_destination(self):
        drive = simulate(make_drive(speed=10.0, num_steps=11), steps=0)  # a route of 10 m
        points = self.observed(drive)[0] * 25
        np.testing.assert_allclose(points[:, 0], [2, 4, 6, 8, 10, 10, 10, 10, 10, 10], atol=1e-5)
        np.testing.assert_allclose(points[:, 1], 0, atol=1e-5)


class TestLightAhead(SensorConformance):
    sensor = LightAhead()

    def test_red_light_is_observed_until_passed(self):
        """The light is at the middle of the ego's 40 m."""
        drive = Simulation([World.from_scenario(make_drive(red=True))])
        for step in range(40):
            light = self.observed(drive)[0]
            apart = 20.0 - drive.state.arc[0, 0]
            wanted = [apart / 50, 0, 0, 1] if apart >= 0 else [1, 0, 0, 0]
            np.testing.assert_allclose(light, wanted, atol=1e-6, err_msg=f"step {step}")
            drive.step([[0.0, 1.0]])
        assert apart < 0

    def test_light_out_of_range_is_not_observed(self):
        drive = Simulation([World.from_scenario(make_drive(red=True))])
        np.testing.assert_array_equal(self.observed(drive, LightAhead(range=15.0)), [[1, 0, 0, 0]])

    def test_light_keeps_its_last_state_after_the_recording(self):
        drive = Simulation([World.from_scenario(make_drive(red=True, num_steps=31, speed=5.0))])
        for _ in range(60):
            drive.step([[0.0, -1.0]])
        assert drive.state.timestep[0] > 31
        assert self.observed(drive)[0, 3] == 1


class TestSurrounding(SensorConformance):
    sensor = Surrounding(objects=5, range=40.0)

    def test_matches_numpy(self, simulation):  # noqa: F811
        state = simulation.state
        found = self.observed(simulation)
        for (world, row), observed in zip(simulation.agents, found, strict=True):
            rows = np.array(oracle.others(state, world, row), int)
            apart = np.hypot(*(state.position[world, rows] - state.position[world, row]).T)
            rows = rows[np.argsort(apart, kind="stable")][: np.count_nonzero(apart <= 40)][:5]
            turn = state.heading[world, rows] - state.heading[world, row]
            wanted = np.zeros((5, 13))
            wanted[: len(rows)] = np.column_stack(
                [
                    np.ones(len(rows)),
                    oracle.in_frame(state, world, row, state.position[world, rows]) / 40,
                    np.cos(turn),
                    np.sin(turn),
                    oracle.in_frame(
                        state, world, row,
                        state.velocity[world, rows] - state.velocity[world, row] + state.position[world, row],
                    ) / 40,
                    state.size[world, rows] / 20,
                    state.object_type[world, rows][:, None] == [1, 2, 3],
                ]
            )  # fmt: skip
            np.testing.assert_allclose(observed, np.clip(wanted, -1, 1), atol=2e-6)
        assert found[..., 0].sum() > 20

    def test_types(self):
        drive = simulate(make_drive(others=(Other(5.0), Other(9.0, type=ObjectType.CYCLIST))), steps=0)
        ego = np.array([[0, 0]], np.int32)
        rows = self.observed(drive, Surrounding(objects=2, types=(ObjectType.CYCLIST,)), ego)[0]
        np.testing.assert_allclose(rows[0, [0, 1, 2, 12]], [1, 9 / 50, 0, 1], atol=1e-6)
        assert not rows[1].any()

    def test_of_equal_distances_the_first_come_first(self):
        """Three objects are 9 m away, one is nearer, and there is room for three."""
        others = (Other(0.0, 9.0), Other(9.0), Other(0.0, -9.0), Other(5.0))
        drive = simulate(make_drive(others=others), steps=0)
        rows = self.observed(drive, Surrounding(objects=3), np.array([[0, 0]], np.int32))[0]
        np.testing.assert_allclose(rows[:, 1:3] * 50.0, [(5.0, 0.0), (0.0, 9.0), (9.0, 0.0)], atol=1e-5)


@pytest.mark.parametrize(
    ("sensor", "wrong"),
    [
        (EgoState, {"max_speed": 0.0}),
        (Navigation, {"points": 0}),
        (LightAhead, {"range": -1.0}),
        (Surrounding, {"objects": 0}),
    ],
)
def test_parameters_out_of_range(sensor, wrong):
    with pytest.raises(BadParameter, match=next(iter(wrong))):
        sensor(**wrong)
