"""Reference paths: none turns back, whatever was recorded."""

from __future__ import annotations

import numpy as np
import pytest

from scenarionet_data.conversion import convert
from scenarionet_data.loader import ScenarioLoader
from scenarionet_sim.policies.idm import Idm
from scenarionet_sim.policies.objects import ego
from scenarionet_sim.simulation.simulation import Simulation
from scenarionet_sim.worlds.paths import without_cusps
from scenarionet_sim.worlds.world import World
from tests.fixtures.drives import make_drive


def num_cusps(world: World) -> int:
    """Number of places at which paths turn by more than a right angle."""
    paths, count = world.paths, 0
    for first, end in zip(paths.path_offsets[:-1], paths.path_offsets[1:], strict=True):
        hops = np.diff(paths.path_points[first:end].astype(np.float64), axis=0)
        count += int(((hops[1:] * hops[:-1]).sum(axis=1) < 0.0).sum())
    return count


@pytest.mark.parametrize(
    ("x", "kept"),
    [
        ([0, 1, 2, 3, 4], [0, 1, 2, 3, 4]),
        ([0, 1, 2, 1.5, 2.5, 3], [0, 1, 2, 4, 5]),  # a step back
        ([0, 1, 2, 1.5, 1.8, 1.9, 3], [0, 1, 2, 6]),  # the way on begins behind
        ([0, -0.2, 1, 2, 3], [1, 2, 3, 4]),  # before it drives off
        ([0, 1, 2, 3, 2.8], [0, 1, 2, 3]),  # at the end
        ([0, 0.1, -0.1, 0.1], [2, 3]),
    ],
)
def test_cusps_are_dropped(x, kept):
    points = np.column_stack([x, np.zeros(len(x))])
    assert without_cusps(points).tolist() == kept


def test_an_ego_that_once_steps_back_is_driven_forwards():
    scenario = make_drive(num_steps=81, speed=15.0)
    scenario.tracks.position[0, 30, 0] -= 4.0  # 2.5 m behind the timestep before
    world = World.from_scenario(scenario)
    assert num_cusps(world) == 0
    simulation = Simulation([world], [Idm(objects=ego)])
    speeds = [float(simulation.state.velocity[0, 0, 0])]
    for _ in range(60):
        simulation.step()
        speeds.append(float(simulation.state.velocity[0, 0, 0]))
    assert min(speeds) > 0.0 and abs(np.diff(speeds)).max() < 1.2


def test_no_step_at_a_kink_accelerates_by_more_than_a_vehicle_can():
    scenario = make_drive(num_steps=81, speed=15.0)
    scenario.tracks.position[0, 10:20, 1] += 0.9 * (np.arange(10) % 2)  # 1.5 m ahead, 0.9 m aside
    simulation = Simulation([World.from_scenario(scenario)], [Idm(objects=ego)])
    velocities = [simulation.state.velocity[0, 0].copy()]
    for _ in range(60):
        simulation.step()
        velocities.append(simulation.state.velocity[0, 0].copy())
    changes = np.hypot(*np.diff(velocities, axis=0).T)
    assert 1.0 < changes.max() < 1.2 + 1e-6


@pytest.mark.parametrize("count", [20, pytest.param(1000, marks=pytest.mark.long)])
def test_paths_of_generated_scenarios_have_no_cusps(count, tmp_path):
    convert("pg", f"0:{count}", tmp_path)
    assert sum(num_cusps(World.from_scenario(scenario)) for scenario in ScenarioLoader(tmp_path)) == 0


@pytest.mark.integration
@pytest.mark.parametrize("source", ["scenarionet", "argoverse2"])
def test_paths_of_recordings_have_no_cusps(source, recordings, tmp_path):
    convert(source, str(recordings / source), tmp_path)
    assert sum(num_cusps(World.from_scenario(scenario)) for scenario in ScenarioLoader(tmp_path)) == 0
