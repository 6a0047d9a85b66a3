"""Offline datasets: episodes of a driver in ``ScenarioNet-v0``, in the format of Minari.

The vehicle is driven in the environment, so observations, actions and rewards belong together. Actions of planners that
answer with trajectories, such as ``log-planner`` with the recording, come from inverse dynamics: what the controls have
to be for the vehicle to be there in time, corrected at each step for where it is.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np

from scenarionet_data import version
from scenarionet_data.arrays.dtypes import Array, Float32
from scenarionet_data.errors import BadParameter, needing
from scenarionet_data.execution.progress import Progress
from scenarionet_sim.backends.base import Drive
from scenarionet_sim.drivers.by_name import RANDOM, resolve_drivers
from scenarionet_sim.environments.config import OBSERVATIONS
from scenarionet_sim.environments.single_agent import ScenarioNetEnv
from scenarionet_sim.planners.base import Planner, Trajectory
from scenarionet_sim.planners.frame import ViewFrame
from scenarionet_sim.planners.policy import Planned
from scenarionet_sim.planners.view import View
from scenarionet_sim.scenarios.selection import Scenarios

if TYPE_CHECKING:
    from minari import MinariDataset

_SOON = 0.5
"""Time in which the vehicle is to be at the place of the trajectory then [s]."""

_REACH = 4.0
"""Least distance to the point of the trajectory that the vehicle steers to [m]."""

_CHUNK = 64
"""Episodes that are written together; an interrupted call loses at most these."""

_TIMES = 0.1 * np.arange(1.0, 41.0)


def record_episodes(
    scenarios: Scenarios,
    dataset_id: str,
    policy: str = "log-planner",
    *,
    observation: str = "paper",
    seed: int = 0,
    on_progress: Progress | None = None,
) -> MinariDataset:
    """Drive each scenario once, and write the episodes as a dataset of Minari.

    ``minari.load_dataset(dataset_id)`` reads it, and its ``recover_environment()`` makes the environment; ``options``
    of each episode name its scenario. Datasets are in ``MINARI_DATASETS_PATH``, by default ``~/.minari/datasets``. A
    second call with the same arguments continues an interrupted one.

    Args:
        scenarios: The scenarios, each an episode, in their order.
        dataset_id: ``namespace/name-v0``.
        policy: A planner by name or as ``module:Class``, or a driver that gets observations, such as ``runs/NAME``.
        observation: A name in ``OBSERVATIONS``: what the dataset has; a driver of observations needs its own.
        seed: Seed of the sensors' noise.
        on_progress: Called after each episode.

    Raises:
        MissingDependency: minari is not installed.
        BadParameter: There is such a dataset of something else, or the policy gives neither actions nor trajectories.
        LakeError: A scenario cannot be read.
    """
    with needing("offline datasets need minari", "learn"):
        import minari
        from minari.data_collector import EpisodeBuffer
    if observation not in OBSERVATIONS:
        raise BadParameter(f"unknown observation {observation!r}; choose from {', '.join(OBSERVATIONS)}")
    begin = _deciding(policy, scenarios.lake, observation)
    env = gymnasium.make("ScenarioNet-v0", scenarios=scenarios, sensors=observation)
    inner = env.unwrapped
    if not isinstance(inner, ScenarioNetEnv):
        raise BadParameter(f"ScenarioNet-v0 is {type(inner).__name__} here; expected ScenarioNetEnv")
    ids = inner.scenario_ids
    description = f"{policy}, seed {seed}, {version.name_and_version()}: {scenarios!r}, {len(ids)} episodes"
    dataset = None
    if dataset_id in minari.list_local_datasets():
        dataset = minari.load_dataset(dataset_id)
        found = dataset.storage.metadata["description"]
        if found != description:
            raise BadParameter(
                f"there is a dataset {dataset_id} of {found!r}, not {description!r}; choose another name or version"
            )
    done = dataset.total_episodes if dataset else 0
    for first in range(done, len(ids), _CHUNK):
        episodes = []
        for number, scenario_id in enumerate(ids[first : first + _CHUNK], first):
            options = {"scenario_id": scenario_id}
            seen, _ = env.reset(seed=seed, options=options)
            episode = EpisodeBuffer(number, seed, options, [seen], [])
            decide, is_over = begin(np.random.default_rng([seed, number])), False
            while not is_over:
                action = decide(inner, seen)
                seen, reward, has_ended, is_late, _ = env.step(action)
                is_over = has_ended or is_late
                for values, value in (
                    (episode.observations, seen),
                    (episode.actions, action),
                    (episode.rewards, reward),
                    (episode.terminations, has_ended),
                    (episode.truncations, is_late),
                ):
                    values.append(value)
            episodes.append(episode)
            if on_progress is not None:
                on_progress(number + 1, len(ids), number + 1)
        if dataset is None:
            with warnings.catch_warnings():
                warnings.filterwarnings("ignore", category=UserWarning, module="minari")  # of an author, say
                dataset = minari.create_dataset_from_buffers(
                    dataset_id, episodes, env, algorithm_name=policy, description=description, data_format="parquet"
                )
        else:
            dataset.update_dataset_from_buffer(episodes)
    env.close()
    if dataset is None:
        raise BadParameter(f"{scenarios!r} selects no scenarios; choose others")
    return dataset


Deciding = Callable[[ScenarioNetEnv, Array], Float32]
"""Returns the action (2,) for an environment and what was observed."""


def _deciding(policy: str, lake: Any, observation: str) -> Callable[[np.random.Generator], Deciding]:
    """Return what makes the driver of an episode, from its random numbers."""
    drivers = resolve_drivers(policy, lake=str(lake))
    if drivers.driver is None:
        driven = drivers.policies[-1]
        if not isinstance(driven, Planned):
            names = "log-planner, idm-planner or lane-graph"
            raise BadParameter(f"{policy} moves vehicles without actions; name a planner, such as {names}")
        return lambda _: _planning(driven.made())
    wanted = getattr(drivers.driver, "sensors", OBSERVATIONS["paper"])
    if policy != RANDOM and wanted != OBSERVATIONS[observation]:
        names = ", ".join(name for name, sensors in OBSERVATIONS.items() if sensors == wanted)
        remedy = f"record observation={names!r}" if names else "they have no name in OBSERVATIONS"
        raise BadParameter(f"{policy} sees by other sensors than those of {observation!r}; {remedy}")
    return lambda rng: _observing(drivers.make_driver(), rng)


def _observing(driver: Any, rng: np.random.Generator) -> Deciding:
    """Return the driver that gets observations; ``reset`` and ``seed`` of its own are optional, see ``Driver``."""
    if hasattr(driver, "reset"):
        driver.reset()
    if hasattr(driver, "seed"):
        driver.seed(rng)
    return lambda _, seen: np.clip(np.asarray(driver.act(seen), np.float32), -1.0, 1.0)


def _planning(planner: Planner) -> Deciding:
    """Return the driver that asks a planner, and turns its trajectories into actions."""
    speed, arc = None, math.nan

    def decide(env: ScenarioNetEnv, seen: Array) -> Float32:
        nonlocal speed, arc
        del seen
        simulation = env.core.simulation
        row = int(simulation.by_place.row_at[0, 0])
        view = View(simulation.batch.worlds[0], simulation.state, 0, row, planner.frame, speed, arc)
        planner.expect(view)
        answer = planner.act(view)
        speed, arc = view.ego.speed, view.known_arc
        if isinstance(answer, Trajectory):
            return action_towards(answer, view)
        return np.clip(np.asarray(answer, np.float32), -1.0, 1.0)

    return decide


def action_towards(trajectory: Trajectory, view: View, vehicle: Drive | None = None) -> Float32:
    """Return the action (2,) float32, steering and throttle, with which a vehicle follows a trajectory.

    The acceleration is that with which it is as far as the trajectory in 0.5 s: ``2 (way - speed t) / t²``. The
    steering is that of the arc of its rear axle to a point ahead (Coulter 1992, as :class:`PurePursuitPlanner`).

    Args:
        trajectory: In the frame of the view.
        view: The moment.
        vehicle: Capabilities of the vehicle; those of ``Drive`` by default.
    """
    vehicle, ego = vehicle or Drive(), view.ego
    soon = min(max(_SOON, trajectory.times[0]), trajectory.times[-1])
    own = ViewFrame(ego.x, ego.y, ego.heading, is_scenario=False)
    ahead = own.points(trajectory.at(np.append(soon, _TIMES))[:, :2])
    acceleration = 2.0 * (float(ahead[0, 0]) - ego.speed * soon) / soon**2
    rear = 0.5 * vehicle.wheelbase * ego.length
    reached = np.hypot(*ahead[1:].T) >= _REACH
    steering = 0.0
    if reached.any():
        x, y = ahead[1 + int(reached.argmax())].tolist()
        steering = math.atan(2.0 * rear * 2.0 * y / ((x + rear) ** 2 + y**2))
    throttle = acceleration / (vehicle.acceleration if acceleration > 0.0 else vehicle.braking)
    return np.array([steering / vehicle.max_steer, throttle], np.float32).clip(-1.0, 1.0)
