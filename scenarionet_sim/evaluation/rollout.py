"""One episode as arrays: trajectories of all objects, contacts of the evaluated vehicle, and the outcome."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Bool, Float64
from scenarionet_sim.environments.batched import ENDS, BatchedEnvironment
from scenarionet_sim.evaluation.drivers import Driver
from scenarionet_sim.task.task import DRIVING
from scenarionet_sim.worlds.world import World

_ENDS = {code: name for name, code in ENDS.items()}
_STRAIGHT_ON = np.zeros((1, 2))


@dataclass(frozen=True, eq=False)
class Rollout:
    """An episode of T moments, the first before any step, with the N objects of the world.

    Attributes:
        scenario_id: The scenario.
        start: Timestep of the log at the first moment.
        dt: Seconds between moments.
        agent: Row of the evaluated vehicle.
        end: ``success``, ``out_of_road`` or ``timeout``.
        completion: Completed share of the route, 0 to 1.
        progress: Distance along the route [m].
        position: (T, N, 2) float64 [m].
        heading: (T, N) float64 [rad].
        velocity: (T, N, 2) float64 [m/s].
        present: (T, N) bool.
        contacts: (T, N) bool objects that the agent's box overlaps.
    """

    scenario_id: str
    start: int
    dt: float
    agent: int
    end: str
    completion: float
    progress: float
    position: Float64
    heading: Float64
    velocity: Float64
    present: Bool
    contacts: Bool

    @property
    def num_steps(self) -> int:
        """Number of steps, T - 1."""
        return len(self.position) - 1


def roll_out(core: BatchedEnvironment, world: World, driver: Driver | None, rng: np.random.Generator) -> Rollout:
    """Drive a scenario to its end.

    Args:
        core: Environment of one world, with one agent.
        world: The scenario.
        driver: Computes the agent's actions; None if a policy drives it.
        rng: Source of the sensors' noise.
    """
    core.begin([0], [world])
    if driver is not None and hasattr(driver, "reset"):
        driver.reset()
    film = RolloutRecorder(world.num_objects)
    film.add(core)
    start, before = int(core.simulation.state.timestep[0]), float(core.arc[0])
    # A loop over timesteps: each depends on the previous one.
    while core.status[0] == DRIVING:
        core.step(_STRAIGHT_ON if driver is None else driver.act(core.observe(rng)[0]))
        film.add(core)
    return film.rollout(core, world, start, before)


class RolloutRecorder:
    """Collects the moments of the first world of an environment.

    Args:
        num_objects: N.
    """

    def __init__(self, num_objects: int) -> None:
        self._rows = slice(0, num_objects)
        self._moments: list[tuple[Array, ...]] = []

    def add(self, core: BatchedEnvironment) -> None:
        """Append the current moment."""
        state, rows = core.simulation.state, self._rows
        arrays = state.position[0], state.heading[0], state.velocity[0], state.present[0], core.contacts[0]
        self._moments.append(tuple(array[rows].copy() for array in arrays))

    def rollout(self, core: BatchedEnvironment, world: World, start: int, before: float) -> Rollout:
        """Return the finished episode; it began at timestep ``start``, ``before`` [m] along its route."""
        position, heading, velocity, present, contacts = map(np.stack, zip(*self._moments, strict=True))
        return Rollout(
            scenario_id=world.scenario_id,
            start=start,
            dt=world.dt,
            agent=int(core.agents[0, 1]),
            end=_ENDS[int(core.status[0])],
            completion=float(core.infos()[0]["route_completion"]),
            progress=float(core.arc[0]) - before,
            position=position,
            heading=heading,
            velocity=velocity,
            present=present,
            contacts=contacts,
        )
