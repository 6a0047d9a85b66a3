"""The simulation loop: order, slots, determinism, appearing and leaving, invalid calls."""

from __future__ import annotations

import pickle
from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest

from scenarionet_data.converters.scenarionet import ScenarioNetPickles
from scenarionet_data.errors import BadParameter
from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_sim.arrays.structures import Series
from scenarionet_sim.backends.base import Drive
from scenarionet_sim.backends.kinematic import Kinematic
from scenarionet_sim.policies.base import Policy
from scenarionet_sim.policies.constant_velocity import ConstantVelocity
from scenarionet_sim.policies.external import External
from scenarionet_sim.policies.idm import Idm
from scenarionet_sim.policies.objects import OfType, TrackIds, ego, other_vehicles, vehicles
from scenarionet_sim.policies.replay import Replay
from scenarionet_sim.policies.route_follower import RouteFollower
from scenarionet_sim.simulation.simulation import Simulation
from scenarionet_sim.worlds.episode_kernels import UNDRIVEN
from scenarionet_sim.worlds.world import World
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.scenarios import make_scenario

TRAFFIC = (Replay(), Idm(), External())


@cache
def drive() -> World:
    others = (Other(20.0, vx=6.0), Other(-20.0, vx=9.0), Other(9.0, 3.5))
    return World.from_scenario(make_drive(others=others, red=True))


@cache
def made() -> list[World]:
    return [World.from_scenario(make_scenario(seed)) for seed in range(3)]


@cache
def large() -> World:
    return World.from_scenario(make_scenario(7, num_objects=50, num_steps=80, num_lights=5, num_lanes=12))


def moments(simulation: Simulation, steps: int, seed: int = 0, slot: int = 0) -> list[np.ndarray]:
    """State arrays of a slot after each of some steps; its agent has its own actions, the others random ones."""
    rng, others, kept = np.random.default_rng(seed), np.random.default_rng(99), []
    for _ in range(steps):
        actions = others.uniform(-1, 1, (len(simulation.agents), 2))
        actions[simulation.agents[:, 0] == slot] = rng.uniform(-1, 1, 2)
        simulation.step(actions)
        state, n = simulation.state, simulation.batch.num_objects[slot]
        arrays = state.motion, state.route, state.present
        kept.append(np.concatenate([array[slot, :n].ravel().astype(float) for array in arrays]))
    return kept


@pytest.mark.parametrize("policies", [TRAFFIC, (ConstantVelocity(), RouteFollower(), External(objects=ego))])
def test_runs_are_bit_identical(policies):
    simulation = Simulation([drive()], policies)
    first = moments(simulation, 30)
    simulation.reset(0)
    again = moments(simulation, 30)
    other = moments(Simulation([drive()], policies), 30)
    np.testing.assert_array_equal(first, again)
    np.testing.assert_array_equal(first, other)


def test_world_is_independent_of_its_neighbours():
    alone = moments(Simulation([drive()], TRAFFIC), 25)
    among = moments(Simulation([*made(), drive(), large()], TRAFFIC), 25, slot=3)
    np.testing.assert_array_equal(alone, among)


def test_results_do_not_depend_on_the_number_of_threads():
    worlds = [*made(), drive(), large()] * 3
    one, several = Simulation(worlds, TRAFFIC), Simulation(worlds, TRAFFIC, threads=3)
    np.testing.assert_array_equal(moments(one, 8), moments(several, 8))
    for name in ("motion", "route", "present", "timestep"):
        np.testing.assert_array_equal(getattr(one.state, name), getattr(several.state, name))
    np.testing.assert_array_equal(one.contacts, several.contacts)
    several.close()


@dataclass(frozen=True)
class Drift(Policy):
    """A policy outside of the compiled step: objects move 1 m along x."""

    def advance(self, batch, now, then, driver, policy_id, dt):
        then.motion[..., 0] += driver == policy_id


def test_policy_of_ones_own_is_called_in_every_step():
    simulation = Simulation([drive(), drive()], (Replay(), Drift(TrackIds(("t2",))), External()))
    before, replayed = simulation.state.position[:, 2].copy(), Simulation([drive(), drive()])
    for step in range(1, 4):
        simulation.step(np.zeros((2, 2)))
        replayed.step(np.zeros((2, 2)))
        np.testing.assert_array_equal(simulation.state.position[:, 2], before + np.array([step, 0.0]))
        np.testing.assert_array_equal(simulation.state.position[:, :2], replayed.state.position[:, :2])


def test_slot_takes_another_world_while_the_others_continue():
    simulation = Simulation([made()[0], drive()], TRAFFIC)
    wanted = moments(Simulation([drive()], TRAFFIC), 20)
    rng = np.random.default_rng(0)
    for t, world in enumerate([large(), made()[1], None, large()] * 5):
        simulation.reset(0, world)
        simulation.step(np.array([[0.1, 0.1], rng.uniform(-1, 1, 2)]))
        state = simulation.state
        arrays = state.motion, state.route, state.present
        np.testing.assert_array_equal(wanted[t], np.concatenate([a[1, :4].ravel().astype(float) for a in arrays]))
    assert simulation.batch.worlds == [large(), drive()]
    assert simulation.state.timestep.tolist() == [1, 20]


def test_known_scenarios_begin_for_the_policies_they_were_prepared_for():
    simulation = Simulation([drive(), made()[0]], TRAFFIC)
    series = Series(np.zeros(2, np.int64), np.zeros(5, np.bool_), np.zeros((5, 2), np.int64))
    slots = np.arange(2)
    assert simulation.begin_known(slots, np.array([3, 4]), series) == -1  # not noted
    simulation.batch.note(slots, np.array([3, 4]), series)
    assert simulation.begin_known(slots, np.array([4, 3, 2]), series) == 1  # the last one is not known
    simulation.observe_begun()
    assert simulation.batch.worlds == [made()[0], drive()]
    assert series.playing.tolist() == [4, 3] and series.was_played.tolist() == [False] * 3 + [True] * 2
    simulation.policies = (Replay(), Idm(headway=9.0), External())
    assert simulation.begin_known(slots, np.array([3, 4]), series) == -1
    assert simulation.batch.worlds == [made()[0], drive()]


def test_reset_begins_at_the_given_timestep():
    simulation = Simulation([large()])
    simulation.reset(0, start=17)
    assert simulation.state.timestep[0] == 17
    np.testing.assert_array_equal(simulation.state.position[0, 0], large().log_position[17, 0])
    hidden = World.from_scenario(make_drive(hidden=slice(0, 6)))
    assert Simulation([hidden]).state.timestep[0] == 6


def test_last_policy_that_selects_an_object_drives_it():
    policies = (
        Replay(),
        ConstantVelocity(objects=OfType((ObjectType.VEHICLE,))),
        Idm(objects=TrackIds(("t2",))),
        External(),
    )
    simulation = Simulation([drive()], policies)
    assert simulation.driver[0].tolist() == [3, 1, 2, 1]
    nobody = Simulation([drive()], [Replay(objects=ego)])
    assert nobody.driver[0].tolist() == [0, UNDRIVEN, UNDRIVEN, UNDRIVEN]
    assert nobody.state.present[0].tolist() == [True, False, False, False]


def test_ego_driven_by_idm_is_not_an_agent():
    simulation = Simulation([drive()], (Replay(), Idm(objects=ego)))
    assert len(simulation.agents) == 0
    for _ in range(30):
        simulation.step()
    assert 5.0 < simulation.state.position[0, 0, 0] < 20.0  # behind t1, before the light


def test_contacts_list_the_objects_an_agent_hits():
    cone = Other(12.0, type=ObjectType.TRAFFIC_CONE)
    world = World.from_scenario(make_drive(others=(cone, Other(4.0, 3.5, vx=10.0))))
    simulation = Simulation([world])
    touched = []
    for _ in range(25):
        simulation.step([[0.0, 0.0]])
        touched.append(simulation.contacts[0].tolist())
        assert simulation.hits[0] == (1 << ObjectType.TRAFFIC_CONE if simulation.contacts[0, 1] else 0)
    first = touched.index([False, True, False])
    assert 0.1 * (first + 1) * 10.0 + 2.3 > 12.0 - 0.2 >= 0.1 * first * 10.0 + 2.3
    assert touched[-1] == [False, False, False]


def test_agents_are_located_on_their_route():
    simulation = Simulation([drive()])
    for _ in range(20):
        simulation.step([[0.05, 0.0]])
    arc, lateral, position = simulation.state.arc[0, 0], simulation.state.lateral[0, 0], simulation.state.position[0, 0]
    np.testing.assert_allclose([arc, lateral], position, atol=1e-4)
    assert lateral > 0.5
    assert simulation.previous.arc[0, 0] < arc


def test_agents_are_in_row_order():
    """Contiguous rows avoid a second compilation of each kernel."""
    for worlds in ([drive()], [drive(), drive()], [*made(), drive()]):
        assert Simulation(worlds, (Replay(), External(objects=vehicles))).agents.flags.c_contiguous


def test_actions_are_checked():
    simulation = Simulation([drive(), drive()])
    with pytest.raises(BadParameter, match="1 actions for 2 agents"):
        simulation.step([[0.0, 0.0]])
    with pytest.raises(BadParameter, match="not finite"):
        simulation.step([[0.0, 0.0], [np.nan, 0.0]])
    simulation.step([[7.0, 3.0], [1.0, 1.0]])
    np.testing.assert_array_equal(simulation.state.position[0], simulation.state.position[1])


def test_worlds_of_one_simulation_have_one_timestep():
    slow = World.from_scenario(make_scenario(1))
    object.__setattr__(slow, "dt", 0.5)
    with pytest.raises(BadParameter, match=r"0\.5 s among worlds of 0\.1 s"):
        Simulation([drive(), slow])


def test_simulation_without_moving_objects_runs():
    lonely = World.from_scenario(make_scenario(0, num_objects=1, num_lights=0, has_map=False))
    simulation = Simulation([lonely], TRAFFIC)
    simulation.step([[0.0, 0.0]])
    assert simulation.contacts.shape == (1, 1)


def test_specifications_are_picklable():
    policies = (
        Replay(), Idm(headway=2.0), External(objects=vehicles), ConstantVelocity(objects=OfType((ObjectType.CYCLIST,))),
        RouteFollower(objects=other_vehicles, beyond=50.0), Idm(objects=TrackIds(("a", "b"))),
    )  # fmt: skip
    assert pickle.loads(pickle.dumps(policies)) == policies
    backend = Kinematic(Drive(max_speed=20.0))
    assert pickle.loads(pickle.dumps(backend)) == backend


def test_recorded_scenarios_replay_exactly_and_run_with_traffic(recordings):
    converter = ScenarioNetPickles()
    folders = [str(recordings / "scenarionet" / name) for name in ("nuscenes_0", "waymo_0")]
    worlds = [
        World.from_scenario(converter.scenario(shard, record))
        for folder in folders
        for shard in converter.shards(folder, "train", converter.release, converter.Options())
        for record in converter.records(shard)
    ]
    replayed, traffic = Simulation(worlds, [Replay()]), Simulation(worlds, (Replay(), RouteFollower(), External()))
    for t in range(1, 90):
        replayed.step()
        traffic.step()
        for slot, world in enumerate(worlds):
            valid = np.flatnonzero(world.log_valid[t])
            np.testing.assert_array_equal(replayed.state.position[slot, valid], world.log_position[t, valid])
        assert np.isfinite(traffic.state.position).all() and np.isfinite(traffic.state.heading).all()
