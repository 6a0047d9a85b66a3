"""One episode as arrays: trajectories of all objects, contacts of the evaluated vehicle, and the outcome."""

from __future__ import annotations

from dataclasses import dataclass, replace

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
        end: ``success``, ``out_of_road``, ``timeout``, or ``unfinished`` if the episode is over before.
        end_step: Step in which that was decided; None if unfinished.
        num_scored: Number of steps that metrics look at; the steps after them only decide the outcome.
        completion: Completed share of the route, 0 to 1.
        progress: (T,) distance along the route since the first moment [m].
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
    end_step: int | None
    num_scored: int
    completion: float
    progress: Float64
    position: Float64
    heading: Float64
    velocity: Float64
    present: Bool
    contacts: Bool

    @property
    def num_steps(self) -> int:
        """Number of steps, T - 1."""
        return len(self.position) - 1

    def scored(self) -> Rollout:
        """The part that metrics look at, without the moments after the agent has left at the end of its path."""
        seen = np.flatnonzero(self.present[: self.num_scored + 1, self.agent])
        part = slice(0, int(seen[-1]) + 1 if len(seen) else 0)
        names = "progress", "position", "heading", "velocity", "present", "contacts"
        return replace(self, **{name: getattr(self, name)[part] for name in names})


def roll_out(
    core: BatchedEnvironment,
    world: World,
    driver: Driver | None,
    rng: np.random.Generator,
    *,
    start: int | None = None,
    num_steps: int | None = None,
    waits: bool = True,
) -> Rollout:
    """Drive a scenario.

    Args:
        core: Environment of one world, with one agent.
        world: The scenario.
        driver: Computes the agent's actions; None if a policy drives it.
        rng: Source of the sensors' noise, and of a random driver.
        start: Timestep of the log at which to begin; None for the first at which the ego is valid.
        num_steps: Steps to drive and to score; None for all until the ego's last recorded state.
        waits: Drive on until the outcome is decided.
    """
    core.is_observing = driver is not None
    core.begin([0], [world], start)
    if driver is not None and hasattr(driver, "reset"):
        driver.reset()
    if driver is not None and hasattr(driver, "seed"):
        driver.seed(rng)
    film = RolloutRecorder(world.num_objects)
    film.add(core)
    begun = int(core.simulation.state.timestep[0])
    if num_steps is None:
        num_steps = int(np.flatnonzero(world.log_valid[:, world.ego])[-1]) - begun
    end: int | None = None
    step, status = 0, DRIVING
    # A loop over timesteps: each depends on the previous one.
    while step < num_steps or (waits and end is None):
        core.step(_STRAIGHT_ON if driver is None else driver.act(core.observe(rng)[0]))
        film.add(core)
        step += 1
        if end is None and core.status[0] != DRIVING:
            end, status = step, int(core.status[0])
    return film.rollout(core, world, begun, num_steps, status, end)


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
        self._moments.append((core.arc[:1].copy(), *(array[rows].copy() for array in arrays)))

    def rollout(
        self,
        core: BatchedEnvironment,
        world: World,
        start: int,
        num_scored: int,
        status: int,
        end_step: int | None,
    ) -> Rollout:
        """Return the finished episode.

        Args:
            core: Environment that has played it.
            world: The scenario.
            start: Timestep of the log at which it began.
            num_scored: Steps that metrics look at.
            status: Status that ended it.
            end_step: The step in which.
        """
        arc, position, heading, velocity, present, contacts = map(np.stack, zip(*self._moments, strict=True))
        return Rollout(
            scenario_id=world.scenario_id,
            start=start,
            dt=world.dt,
            agent=int(core.agents[0, 1]),
            end=_ENDS.get(status, "unfinished"),
            end_step=end_step,
            num_scored=num_scored,
            completion=float(core.infos()[0]["route_completion"]),
            progress=arc[:, 0] - arc[0, 0],
            position=position,
            heading=heading,
            velocity=velocity,
            present=present,
            contacts=contacts,
        )
