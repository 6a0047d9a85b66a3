"""A scenario as arrays: the log bit for bit, paths, sizes, lights, and missing parts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarionet_data.arrays.geometry import wrap_angle
from scenarionet_data.converters.argoverse1 import Argoverse1
from scenarionet_data.converters.scenarionet import ScenarioNetPickles
from scenarionet_sim.arrays.log import YAW_RATE, Z
from scenarionet_sim.policies.replay import Replay
from scenarionet_sim.simulation.simulation import Simulation
from scenarionet_sim.worlds.path_kernels import find_stops
from scenarionet_sim.worlds.paths import SPACING
from scenarionet_sim.worlds.world import World
from tests.fixtures import argoverse1
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.reading import scenarios
from tests.fixtures.scenarios import make_scenario


@pytest.mark.parametrize("seed", range(4))
def test_log_equals_the_tracks(seed):
    scenario = make_scenario(seed)
    world, tracks = World.from_scenario(scenario), scenario.tracks
    np.testing.assert_array_equal(world.log_position, tracks.position[..., :2].swapaxes(0, 1))
    np.testing.assert_array_equal(world.log[..., Z], tracks.position[..., 2].T)
    np.testing.assert_array_equal(world.log_heading, tracks.heading.T)
    np.testing.assert_array_equal(world.log_velocity, tracks.velocity.swapaxes(0, 1))
    np.testing.assert_array_equal(world.log_valid, tracks.valid.T)
    assert (world.scenario_id, world.dt, world.ego) == (scenario.id, 0.1, scenario.ego_index)
    assert (world.num_steps, world.num_objects) == (scenario.num_timesteps, len(tracks))


@given(
    steps=st.lists(st.floats(0.02, 0.6), min_size=20, max_size=40),
    dt=st.sampled_from([0.05, 0.1]),
    scale=st.floats(0, 1),
)
def test_worlds_replay_recordings_at_their_own_timestep(steps, dt, scale):
    """Whatever the recorded times: where the ego is after k steps is where it was after k * dt seconds."""
    drive = make_drive(speed=9.0, num_steps=len(steps) + 1)
    times = np.concatenate([[0.0], np.cumsum(steps)]) * (0.2 + scale)
    x = 9.0 * times
    drive.tracks.position[0, :, 0] = x
    world = World.from_scenario(replace(drive, timestamps=times, dt=float(np.median(np.diff(times)))), dt)
    assert world.dt == dt
    assert world.log_valid[:, 0].all()
    assert abs((world.num_steps - 1) * dt - times[-1]) <= dt / 2 + 1e-9
    np.testing.assert_allclose(world.log_position[:, 0, 0], 9.0 * dt * np.arange(world.num_steps), atol=2e-3)
    np.testing.assert_allclose(world.log_velocity[:, 0, 0], 9.0, atol=1e-3)
    simulation = Simulation([world], [Replay()])
    for k in range(1, world.num_steps):
        simulation.step()
        assert simulation.state.position[0, 0, 0] == pytest.approx(9.0 * dt * k, abs=2e-3)


def test_recorded_and_resampled_lakes_give_the_same_world(tmp_path):
    argoverse1.write_recordings(tmp_path, 3)
    drives = [scenarios(Argoverse1(), tmp_path, has_map=False, frames=frames) for frames in ("recorded", "resampled")]
    for recorded, resampled in zip(*drives, strict=True):
        world, wanted = World.from_scenario(recorded), World.from_scenario(resampled)
        assert (world.log_valid == wanted.log_valid).all()
        np.testing.assert_allclose(world.log_position, wanted.log_position, atol=1e-3)
        np.testing.assert_allclose(world.log_velocity, wanted.log_velocity, atol=1e-3)


def test_yaw_rate_is_the_central_difference_of_the_heading():
    scenario = make_scenario(3)
    heading = wrap_angle(np.arange(31) * 0.4 + 2.0)  # several turns
    scenario.tracks.heading[:] = np.where(scenario.tracks.valid, heading, 0.0)
    world, valid, time = World.from_scenario(scenario), scenario.tracks.valid, scenario.timestamps
    for n in range(len(valid)):
        for t in np.flatnonzero(valid[n]):
            first = t - 1 if t > 0 and valid[n, t - 1] else t
            last = t + 1 if t + 1 < len(time) and valid[n, t + 1] else t
            wanted = (last - first) * 0.4 / (time[last] - time[first]) if last > first else 0.0
            assert world.log[t, n, YAW_RATE] == pytest.approx(wanted, rel=1e-4)


def test_sizes_are_medians_over_the_valid_steps():
    scenario = make_scenario(1)
    tracks, world = scenario.tracks, World.from_scenario(scenario)
    for n in range(len(tracks)):
        seen = tracks.size[n, tracks.valid[n]]
        wanted = np.median(seen, axis=0) if len(seen) else np.zeros(3)
        np.testing.assert_allclose(world.size[n], wanted, rtol=1e-6)


def test_paths_drop_points_closer_than_their_spacing():
    scenario = make_scenario(2)
    scenario.tracks.position[1] = np.cumsum(np.full((31, 3), 0.03), axis=0) * scenario.tracks.valid[1, :, None]
    world = World.from_scenario(scenario)
    paths = world.paths
    for n in range(world.num_objects):
        kept: list[np.ndarray] = []
        for point in world.log_position[world.log_valid[:, n], n]:
            if not kept or np.hypot(*(point - kept[-1])) >= SPACING:
                kept.append(point)
        here = slice(paths.path_offsets[n], paths.path_offsets[n + 1])
        np.testing.assert_array_equal(paths.path_points[here], np.array(kept).reshape(-1, 2))
        steps = np.hypot(*np.diff(np.array(kept, float).reshape(-1, 2), axis=0).T)
        wanted = np.append(0.0, np.cumsum(steps))[: len(kept)]
        np.testing.assert_allclose(paths.path_arc[here], wanted, atol=1e-3)
        assert paths.length()[n] == pytest.approx(wanted[-1] if len(wanted) else 0.0, abs=1e-3)


def test_lights_without_a_stop_point_stop_at_the_start_of_their_lane():
    scenario = make_scenario(0, num_lights=3, num_lanes=2)
    world = World.from_scenario(scenario)
    assert world.light_lane.tolist() == [0, 1, -1]
    np.testing.assert_array_equal(world.light_stop[0], scenario.lights.stop_point[0, :2])
    np.testing.assert_array_equal(world.light_stop[1], world.roads.lanes[1][0])
    assert np.isnan(world.light_stop[2]).all()


def test_light_stops_the_paths_through_its_lane():
    beside, across = Other(-20.0, 3.5, vx=12.0), Other(20.0, -10.0, vy=10.0)
    world = World.from_scenario(make_drive(others=(beside, across), red=True))
    assert world.stops.stop_light.tolist() == [0]
    assert world.stops.stop_offsets.tolist() == [0, 1, 1, 1]
    assert world.stops.stop_arc[0] == pytest.approx(20.0, abs=1e-3)


def test_world_may_lack_map_lights_and_others():
    world = World.from_scenario(make_scenario(0, num_objects=1, num_lights=0, has_map=False))
    assert (world.num_objects, world.roads.num_lanes, len(world.light_lane)) == (1, 0, 0)
    assert world.extents[0] < world.extents[2]


def test_recorded_scenarios_become_worlds(recordings):
    converter = ScenarioNetPickles()
    folder = str(recordings / "scenarionet" / "waymo_0")
    (shard, *_) = converter.shards(folder, "train", converter.release, converter.Options())
    scenario = converter.scenario(shard, next(iter(converter.records(shard))))
    world = World.from_scenario(scenario)
    assert world.roads.num_lanes > 50
    np.testing.assert_array_equal(world.log_valid, scenario.tracks.valid.T)
    assert np.isfinite(world.log).all()
    assert (np.diff(world.paths.path_arc) > 0).sum() == np.maximum(np.diff(world.paths.path_offsets) - 1, 0).sum()


def stop_on(way, path):
    """Arc length at which a path meets the stop point (10, 0) of a light over a lane along ``way``; NaN for none."""

    def rows(points):
        points = np.asarray(points, np.float32)
        found = np.zeros((len(points), 5), np.float32)
        found[:, :2] = points
        found[1:, 4] = np.cumsum(np.hypot(*np.diff(points, axis=0).T))
        return found, np.array([0, len(points)], np.int32)

    stops = np.full((1, 1), np.nan, np.float32)
    find_stops(*rows(path), np.zeros(1, np.int32), np.array([[10.0, 0.0]], np.float32), *rows(way), stops)
    return stops[0, 0]


def test_a_light_governs_paths_that_stay_on_its_lane():
    lane = [[10, 0], [20, 0], [40, 0]]
    assert stop_on(lane, [[0, 0], [15, 0], [50, 0]]) == pytest.approx(10.0)
    assert stop_on(lane, [[0, 1], [15, 1], [50, 1]]) == pytest.approx(10.0), "beside the middle"
    assert np.isnan(stop_on(lane, [[0, 2], [15, 2], [50, 2]])), "on the next lane"
    assert np.isnan(stop_on(lane, [[0, 0], [10, 0], [20, 8], [30, 16]])), "turns off"
    assert np.isnan(stop_on(lane, [[50, 0], [10, 0], [0, 0]])), "comes from the other side"
    assert np.isnan(stop_on(lane, [[0, 0], [10.5, 0]])), "ends at the light"
    assert stop_on([[10, 0], [14, 0]], [[0, 0], [15, 0], [50, 0]]) == pytest.approx(10.0), "goes on after the lane"
