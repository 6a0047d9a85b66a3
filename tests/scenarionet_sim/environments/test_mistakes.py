"""Plausible mistakes with environments, cameras and simulations end in a sentence that says what was expected."""

from __future__ import annotations

import inspect
import math
from dataclasses import fields

import numpy as np
import pytest

from scenarionet_data import Lake
from scenarionet_data.errors import BadParameter
from scenarionet_sim import (
    BirdView,
    Bullet,
    Camera,
    Curriculum,
    Drive,
    EgoState,
    Fleet,
    Idm,
    IdmPlanner,
    Kinematic,
    LaneLineDetector,
    LaneRoute,
    Lidar,
    LightAhead,
    Live,
    Lqr,
    Mount,
    Navigation,
    Planned,
    PointCloud,
    Replay,
    Reward,
    ScenarioNetEnv,
    ScenarioNetParallelEnv,
    ScenarioNetVectorEnv,
    Scenarios,
    SceneLidar,
    SearchSpace,
    Simulation,
    Surrounding,
    Termination,
    Trajectory,
    Weather,
    World,
    camera_ring,
    compare_runs,
    ego,
    evaluate,
    record,
    rollout_moments,
    search,
    vehicles,
)
from scenarionet_sim.environments.config import EnvConfig, MultiAgentConfig, VectorConfig
from tests.fixtures.lakes import write_lake
from tests.fixtures.scenarios import make_scenario


@pytest.fixture
def env(only):
    return ScenarioNetEnv(scenarios=only("crowd"))


@pytest.mark.parametrize(
    ("setting", "value"),
    [
        ("sensors", "camera"),
        ("sensors", ["lidar"]),
        ("sensors", Camera),
        ("sensors", (Lidar,)),
        ("sensors", ()),
        ("policies", "idm"),
        ("policies", ("replay",)),
        ("policies", (Idm,)),
        ("backend", "bullet"),
        ("reward", {"speed": 1.0}),
        ("termination", None),
        ("dt", "a"),
        ("dt", math.inf),
        ("prefetch", 1.5),
        ("prefetch", -1),
        ("cache_size", 0),
    ],
)
def test_settings(only, setting, value):
    with pytest.raises(BadParameter, match=rf"{setting}.*(expected|needs)|expected.*{setting}"):
        ScenarioNetEnv(scenarios=only("crowd"), **{setting: value})


@pytest.mark.parametrize("options", [3, "x", {"timestep": 3}, {"scenario_id": "made/v1/0"}])
def test_a_batch_has_no_reset_options(only, options):
    """They were ignored, and other scenarios played."""
    envs = ScenarioNetVectorEnv(num_envs=1, scenarios=only("crowd"))
    with pytest.raises(BadParameter, match=r"options=.*; a batch has no options.*choose scenarios by scenarios="):
        envs.reset(options=options)
    envs.reset(options={})


def test_one_sensor_needs_no_tuple(only):
    env = ScenarioNetEnv(scenarios=only("crowd"), sensors=EgoState())
    assert env.config.sensors == (EgoState(),)
    assert env.reset(seed=0)[0].shape == EgoState().shape


def test_scenarios_in_the_place_of_the_configuration(only):
    with pytest.raises(BadParameter, match="expected a EnvConfig; pass scenarios="):
        ScenarioNetEnv(only("crowd"))


@pytest.mark.parametrize(
    "options",
    [
        {"scenario": "pg/v2/3"},
        "pg/v2/3",
        {"timestep": "a"},
        {"timestep": 1.5},
        {"timestep": -1},
        ["timestep"],
        np.array([1, 2]),
    ],
)
def test_reset_options(only, env, options):
    with pytest.raises(BadParameter, match=r"(expected|choose)"):
        env.reset(options=options)
    with pytest.raises(BadParameter, match=r"(expected|choose)"):
        ScenarioNetParallelEnv(scenarios=only("crowd")).reset(options=options)


@pytest.mark.parametrize("seed", [-1, 1.5, "a"])
def test_seeds(only, env, seed):
    with pytest.raises(BadParameter, match=r"seed=.* expected a whole number"):
        env.reset(seed=seed)
    with pytest.raises(BadParameter, match=r"seed=.* expected a whole number"):
        ScenarioNetVectorEnv(num_envs=1, scenarios=only("crowd"), seed=seed).reset()


@pytest.mark.parametrize(
    "action",
    [None, "left", 3, ["a", "b"], [math.nan, 0.0], [math.inf, 0.0], [10**400, 0.0], [[0.0, 1.0], 2.0]],
)
def test_actions(env, action):
    env.reset(seed=0)
    with pytest.raises(BadParameter, match="action"):
        env.step(action)


@pytest.mark.parametrize("action", [[0.0], ["a", "b"], "left"])
def test_actions_of_many_agents(only, action):
    env = ScenarioNetParallelEnv(scenarios=only("crowd"))
    env.reset(seed=0)
    with pytest.raises(BadParameter, match="actions"):
        env.step([action])
    with pytest.raises(BadParameter, match="actions"):
        env.step(dict.fromkeys(env.agents, action))


@pytest.mark.parametrize(
    "counts",
    [{"num_envs": 0}, {"num_envs": 1.5}, {"threads": -1}, {"threads": "a"}, {"prefetch": None}, {"prefetch": "x"}],
)
def test_counts_of_a_batch(only, counts):
    with pytest.raises(BadParameter, match=rf"{next(iter(counts))}=.* expected"):
        ScenarioNetVectorEnv(**{"num_envs": 2, "scenarios": only("crowd"), **counts})


@pytest.mark.parametrize(
    "options",
    [
        {"width": 1.5},
        {"height": "84"},
        {"width": 0},
        {"channels": "rgb"},
        {"channels": ("colour",)},
        {"channels": ()},
        {"fov": 120},
        {"fov": "wide"},
        {"mount": (1.2, 0.0, 1.5)},
        {"weather": "rain"},
        {"range": math.inf},
        {"threads": 0},
        {"device": "gpu"},
        {"has_scenery": "x"},
        {"are_boxes": 1},
        {"lens": 3},
    ],
)
def test_cameras(options):
    with pytest.raises(BadParameter, match=next(iter(options)) if "width" not in options else "width|pixels"):
        Camera(**options)


@pytest.mark.parametrize(
    "options",
    [
        {"channels": (["rgb"],)},
        {"fov": None},
        {"mount": "front"},
        {"intrinsics": (1.0, 2.0)},
        {"distortion": 3.0},
        {"seed": -1},
        {"seed": "x"},
    ],
)
def test_numbers_of_cameras(options):
    with pytest.raises(BadParameter, match=f"{next(iter(options))}=.*expected"):
        Camera(**options)


def test_frames_of_something_else(only):
    """Agents that are not in the simulation ended the process."""
    world = World.from_scenario(only("crowd").open()[0][0])
    simulation, camera = Simulation([world], Replay()), Camera(8, 6)
    for batch, state in ((world, None), (None, None), (simulation.batch, None), (simulation.state, simulation.batch)):
        with pytest.raises(BadParameter, match=r"expected \(simulation.batch, simulation.state, agents\), found"):
            camera.frames(batch, state, None)
    for agents in (None, 0, [0], [[0, 10**6]], [[-1, 0]], [[5, 0]], np.zeros((1, 3), np.int32), np.zeros((1, 2))):
        with pytest.raises(BadParameter, match=r"agents=.* expected world and row of each"):
            camera.frames(simulation.batch, simulation.state, agents)
    ego = [[0, int(simulation.batch.ego[0])]]
    assert camera.frames(simulation.batch, simulation.state, ego)["rgb"].shape == (1, 6, 8, 3)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (lambda lake, world: Mount("x"), "x='x'; expected a finite number"),
        (lambda lake, world: Mount(pitch=math.nan), "pitch=nan; expected a finite number"),
        (lambda lake, world: Mount(z=1e7), "Mount.*z=10000000.0.*; expected levels .* below a million"),
        (lambda lake, world: BirdView(size=10**6), "size=1000000; a bird's view has 1 to 8192 pixels"),
        (lambda lake, world: ego(None), r"world=None; expected World.from_scenario\(scenario\)"),
        (lambda lake, world: vehicles("x"), r"world='x'; expected World.from_scenario"),
        (lambda lake, world: Simulation([world]).reset(9), "slot=9; expected a whole number from 0 to 0"),
        (lambda lake, world: Simulation([world]).reset("x"), "slot='x'; expected a whole number"),
        (lambda lake, world: Simulation([world], threads="x"), "threads='x'; expected at least 1"),
        (
            lambda lake, world: SearchSpace("cut_in", "idm", parameters=3),
            "parameters=3; expected distributions",
        ),
        (lambda lake, world: SearchSpace("cut_in", "idm", monotone="gap"), "monotone='gap'; expected names of"),
        (
            lambda lake, world: search(None, SearchSpace("cut_in", "idm"), name="x"),
            "lake=None; expected a lake",
        ),
        (lambda lake, world: search(lake, None, name="x"), "space=None; expected SearchSpace"),
        (lambda lake, world: search(lake, SearchSpace("cut_in", "idm"), name=None), "name=None; expected a text"),
        (lambda lake, world: Idm("vehicles"), "objects='vehicles'; expected a function of a world"),
        (lambda lake, world: Idm(headway=math.nan), "headway=nan; expected a number above 0"),
        (lambda lake, world: Reward(displacement=math.nan), "displacement=nan; expected a finite number"),
        (lambda lake, world: Termination(off_route="x"), "off_route='x'; expected a finite number"),
        (lambda lake, world: Weather("x"), "sun_elevation='x'; expected a finite number"),
        (lambda lake, world: camera_ring(6), "camera=6; expected a Camera"),
        (lambda lake, world: SceneLidar("x"), "elevations='x'; expected angles"),
        (lambda lake, world: LightAhead("x"), "range='x'; expected a number above 0"),
        (lambda lake, world: Live("x"), "width and height of a window must be positive, found 'x'"),
        (lambda lake, world: Live().picture(world, None), r"expected picture\(world, simulation.state\), found World"),
        (lambda lake, world: Simulation([world], "idm"), r"policies=.*expected policies, such as \(Replay"),
        (lambda lake, world: Simulation([world], 3), r"policies=\(3,\); expected policies"),
        (lambda lake, world: Scenarios(None), "lake=None; expected a lake, its path or its URL"),
        (lambda lake, world: Scenarios(lake, 3), "database=3; expected a database, its name, or scenario ids"),
        (lambda lake, world: Scenarios(lake, where=3), "where=3; expected SQL as text"),
        (lambda lake, world: Scenarios(lake, curriculum=3), "curriculum=3; expected, for example, Curriculum"),
        (lambda lake, world: Scenarios(lake, worker="x"), "worker='x'; expected a whole number"),
        (lambda lake, world: evaluate(lake, policy=Idm()), "policy=Idm.*; expected a name such as 'idm'"),
        (lambda lake, world: evaluate(lake, policy="idm", seed="x"), "seed='x'; expected a whole number"),
        (lambda lake, world: evaluate(lake, policy="idm", num_rollouts="2"), "'2' rollouts of each scenario; expected"),
        (lambda lake, world: evaluate(lake, policy="idm", name=3), "3 is not a valid name of a run"),
        (lambda lake, world: evaluate(lake, policy="idm", workers="x"), "workers='x'; expected a whole number"),
        (lambda lake, world: record(lake, name="x", cameras=Camera(8, 6)), "expected a tuple of cameras"),
        (lambda lake, world: compare_runs(lake, "a", "b"), "the lake has no run 'a'; it has none"),
        (lambda lake, world: rollout_moments(lake, "a", None), r"scene=None; expected what scene_of"),
        (lambda lake, world: World.from_scenario(Lake(lake).loader()[0], "x"), "dt: expected a timestep above 0 s"),
        (lambda lake, world: Simulation([world], backend="x"), r"backend='x'; expected, for example, Kinematic\(\)"),
        (lambda lake, world: Simulation([world], backend=Kinematic), "backend=.*; expected, for example, Kinematic"),
        (lambda lake, world: Scenarios(lake, snapshot="x"), "snapshot='x'; expected a whole number"),
        (lambda lake, world: Curriculum("x"), "levels='x'; expected a whole number"),
        (lambda lake, world: Curriculum(0), "levels=0; expected a whole number of 1 or more"),
        (lambda lake, world: Curriculum(success=None), "success=None; expected a finite number"),
        (lambda lake, world: Curriculum(episodes="x"), "episodes='x'; expected a whole number of 1 or more, or None"),
        (lambda lake, world: Curriculum(by=3), "by=3; expected a text"),
        (lambda lake, world: Kinematic("x"), r"drive='x'; expected a Drive, or Fleet\(\)"),
        (lambda lake, world: Kinematic(substeps=0), "substeps=0; expected a whole number of 1 or more"),
        (lambda lake, world: Bullet("x"), r"drive='x'; expected for example Drive\(\)"),
        (lambda lake, world: Bullet(substeps=0), "substeps=0; expected a whole number of 1 or more"),
        (lambda lake, world: Drive("x"), "max_steer='x'; expected a finite number"),
        (lambda lake, world: Fleet(lorry=3), r"lorry=3; expected for example Drive\(\)"),
        (lambda lake, world: Fleet(spread=3), r"spread=3; expected a share in \[0, 1\)"),
        (lambda lake, world: Lqr("x"), "speed_weight='x'; expected a finite number"),
        (lambda lake, world: Lqr(horizon=1.5), "horizon=1.5; expected a whole number"),
        (lambda lake, world: Lqr(step=0), "step=0; expected a number above 0"),
        (lambda lake, world: Planned(planner=3), "planner=3; expected a class of planners, such as IdmPlanner"),
        (
            lambda lake, world: Planned(planner=IdmPlanner, tracker="x"),
            r"tracker='x'; expected, for .* tracker=Lqr\(\)",
        ),
        (lambda lake, world: Planned(planner=IdmPlanner, tracker=Lqr), r"tracker=.*; expected, .* tracker=Lqr\(\)"),
        (lambda lake, world: Planned(planner=IdmPlanner, backend="x"), "backend='x'; expected, for example, backend=K"),
        (lambda lake, world: Trajectory("x", "y"), "a trajectory of 'x' at 'y'; expected numbers"),
        (lambda lake, world: Idm(route="x"), r"route='x'; expected LaneRoute\(goal\), or None"),
        (lambda lake, world: LaneRoute("xy"), r"goal='xy'; expected a point \(x, y\) \[m\], a function, or None"),
        (lambda lake, world: LaneRoute((1, "x")), r"goal=\(1, 'x'\); expected a point"),
        (lambda lake, world: Lidar(types="VEHICLE"), "types='VEHICLE'; expected ObjectTypes, such as .*, or None"),
        (lambda lake, world: Surrounding(types=("VEHICLE",)), r"types=\('VEHICLE',\); expected ObjectTypes"),
        (lambda lake, world: LaneLineDetector(types=3), "types=3; expected MapFeatureTypes"),
        (lambda lake, world: Navigation(spacing="x"), "spacing='x'; expected a number above 0"),
        (lambda lake, world: BirdView(resolution="x"), "resolution='x'; expected a number above 0"),
        (lambda lake, world: PointCloud(mount="x"), "mount='x'; expected a number above 0"),
        (lambda lake, world: SceneLidar((0.1,), has_scenery="x"), "has_scenery='x'; expected True or False"),
        (lambda lake, world: Camera(8, 6).split(None), r"observed: expected an array \(\.\.\., 6, 8, 3\), found None"),
        (lambda lake, world: Camera(8, 6).split(np.zeros((5, 5))), r"observed: .* found \(5, 5\)"),
    ],
)
def test_simulations_and_runs(wrong, message, lake, world):
    with pytest.raises(BadParameter, match=message):
        wrong(lake, world)


@pytest.fixture(scope="module")
def lake(tmp_path_factory):
    return write_lake(tmp_path_factory.mktemp("mistakes") / "lake", [make_scenario(1)]).root


@pytest.fixture(scope="module")
def world(lake):
    return World.from_scenario(Lake(lake).loader()[0])


@pytest.mark.parametrize(
    "name, value", [("rays", 1.5), ("rays", -1), ("range", -1.0), ("range", math.inf), ("range", math.nan)]
)
def test_rays(name, value):
    with pytest.raises(BadParameter, match=name):
        Lidar(**{name: value})


def test_simulations(only):
    loader, _ = only("crowd").open()
    world = World.from_scenario(loader[0])
    for worlds in (world, [], [loader[0]], None):
        with pytest.raises(BadParameter, match=r"worlds=.* expected one or more"):
            Simulation(worlds)
    with pytest.raises(BadParameter, match=r"expected a scenario.*pg/v2/3"):
        World.from_scenario("pg/v2/3")


@pytest.mark.parametrize(
    ("environment", "config"),
    [(ScenarioNetEnv, EnvConfig), (ScenarioNetVectorEnv, VectorConfig), (ScenarioNetParallelEnv, MultiAgentConfig)],
)
def test_signature_shows_all_settings(environment, config):
    """To completion and ``help``."""
    shown = inspect.signature(environment).parameters
    assert {each.name for each in fields(config)} <= shown.keys()
    assert shown["sensors"].default == config.__dataclass_fields__["sensors"].default
    assert {"config", "seed", "render_mode"} <= shown.keys()
    assert "settings" not in shown


def test_settings_are_accepted_as_numpy_numbers(only):
    env = ScenarioNetEnv(scenarios=only("crowd"), sensors=Camera(np.int64(8), np.int32(6)), observation="dict")
    observed, _ = env.reset(seed=np.int64(3), options={"timestep": np.int32(0)})
    assert observed["camera"].shape == (6, 8, 3)
