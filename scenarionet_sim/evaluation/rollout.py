"""One episode as arrays: what everybody did, what the judged vehicle touched, how it ended."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Bool, Float64
from scenarionet_sim.environments.arena import ENDS, Arena
from scenarionet_sim.evaluation.drivers import Driver
from scenarionet_sim.task.task import DRIVING
from scenarionet_sim.worlds.world import World

_ENDS = {code: name for name, code in ENDS.items()}
_STRAIGHT_ON = np.zeros((1, 2))


@dataclass(frozen=True, eq=False)
class Rollout:
    """An episode of T moments, the first before any step, of N objects as in the scenario's world.

    Attributes:
        scenario_id: The scenario.
        start: Timestep of the log at the first moment.
        dt: Seconds between moments.
        agent: Row of the vehicle that is judged.
        end: How it ended: ``success``, ``out_of_road`` or ``timeout``.
        completion: Share of the route that was done, 0 to 1.
        progress: Way along the route [m].
        position: (T, N, 2) float64 [m].
        heading: (T, N) float64 [rad].
        velocity: (T, N, 2) float64 [m/s].
        present: (T, N) bool.
        contacts: (T, N) bool whose box the agent's box overlaps.
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
        """Steps taken: T - 1."""
        return len(self.position) - 1


def roll_out(arena: Arena, world: World, driver: Driver | None, rng: np.random.Generator) -> Rollout:
    """Drive a scenario to its end.

    Args:
        arena: Of one world, with one agent.
        world: The scenario.
        driver: Drives the agent; None where a policy of the arena does.
        rng: Noise of the sensors.
    """
    arena.begin(0, world)
    if driver is not None and hasattr(driver, "reset"):
        driver.reset()
    film = Film(world.num_objects)
    film.add(arena)
    start, before = int(arena.simulation.state.timestep[0]), float(arena.arc[0])
    # A loop over timesteps: each depends on the one before.
    while arena.status[0] == DRIVING:
        arena.step(_STRAIGHT_ON if driver is None else driver.act(arena.observe(rng)[0]))
        film.add(arena)
    return film.rollout(arena, world, start, before)


class Film:
    """Moments of the first world of an arena, one after the other.

    Args:
        num_objects: N.
    """

    def __init__(self, num_objects: int) -> None:
        self._rows = slice(0, num_objects)
        self._moments: list[tuple[Array, ...]] = []

    def add(self, arena: Arena) -> None:
        """Keep the moment."""
        state, rows = arena.simulation.state, self._rows
        arrays = state.position[0], state.heading[0], state.velocity[0], state.present[0], arena.contacts[0]
        self._moments.append(tuple(array[rows].copy() for array in arrays))

    def rollout(self, arena: Arena, world: World, start: int, before: float) -> Rollout:
        """The episode, which has ended; it began at timestep ``start``, ``before`` [m] along its route."""
        position, heading, velocity, present, contacts = map(np.stack, zip(*self._moments, strict=True))
        return Rollout(
            scenario_id=world.scenario_id,
            start=start,
            dt=world.dt,
            agent=int(arena.agents[0, 1]),
            end=_ENDS[int(arena.status[0])],
            completion=float(arena.infos()[0]["route_completion"]),
            progress=float(arena.arc[0]) - before,
            position=position,
            heading=heading,
            velocity=velocity,
            present=present,
            contacts=contacts,
        )
