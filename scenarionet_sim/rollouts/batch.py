"""Rollouts in the slots of one batched environment: a slot whose episode ends begins the next one.

A rollout does not depend on the other slots or on their number.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import islice

import numpy as np
import numpy.typing as npt

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.errors import BadParameter, MissingDependency
from scenarionet_sim.backends.base import Backend, checked_actions
from scenarionet_sim.drivers.by_name import BatchDriver, Driver, Drivers
from scenarionet_sim.environments.batched import BatchedEnvironment
from scenarionet_sim.environments.config import PAPER_OBSERVATION, EnvConfig
from scenarionet_sim.environments.observation import Observation
from scenarionet_sim.policies.base import Policy
from scenarionet_sim.rollouts.rollout import Rollout, RolloutRecorder
from scenarionet_sim.scenarios.selection import Scenarios
from scenarionet_sim.worlds.world import World

SLOTS = 32
"""Rollouts at once: as many as a part of an evaluation has, so that no slot rests while others play twice."""


@dataclass(frozen=True, eq=False)
class RolloutJob:
    """A rollout to simulate.

    Attributes:
        number: Number of the job.
        world: The scenario.
        seed: Seed of stochastic policies, random drivers, and the sensors' noise.
        start: Timestep of the log at which to begin; None for the first at which the ego is valid.
        num_steps: Steps to drive and to score; None for all until the ego's last recorded state.
        waits: Drive on until the outcome is decided.
    """

    number: int
    world: World
    seed: tuple[int, ...] = (0,)
    start: int | None = None
    num_steps: int | None = None
    waits: bool = True


@dataclass(frozen=True, eq=False)
class _Slot:
    """What plays in a slot."""

    job: RolloutJob
    rng: np.random.Generator
    driver: Driver | None


class RolloutBatch:
    """Simulates rollouts.

    Args:
        drivers: Policies of the simulation, and the driver of the agent if there is one.
        backend: Vehicle dynamics of the agent.
        slots: Largest number of rollouts at once.
    """

    def __init__(self, drivers: Drivers, backend: Backend, slots: int = SLOTS) -> None:
        self._drivers, self._backend, self._slots = drivers, backend, slots
        self._drivers_by_slot = {} if drivers.driver is None else {0: drivers.driver}
        self._batch_driver = drivers.driver if isinstance(drivers.driver, BatchDriver) else None

    def run(self, jobs: Iterable[RolloutJob]) -> Iterator[tuple[RolloutJob, Rollout | Exception]]:
        """Yield the rollout of each job, in the order in which they end, or why it failed.

        What fails in a batch is repeated one by one, so that a scenario fails only on its own.
        """
        waiting = iter(jobs)
        while playing := dict(enumerate(islice(waiting, self._slots))):
            try:
                yield from self._play(playing, waiting)
            except (MemoryError, MissingDependency):
                raise
            except Exception as error:  # of one scenario, or of a driver in it
                if self._slots == 1:
                    yield playing[0], error
                else:
                    yield from RolloutBatch(self._drivers, self._backend, slots=1).run(playing.values())

    def _play(
        self, playing: dict[int, RolloutJob], waiting: Iterator[RolloutJob]
    ) -> Iterator[tuple[RolloutJob, Rollout]]:
        """Play until no job is left; ``playing`` are the jobs that are not done, by slot."""
        sensors = getattr(self._drivers.driver, "sensors", None) or PAPER_OBSERVATION
        config = EnvConfig(Scenarios("."), self._drivers.policies, self._backend, cache_size=1)
        core = BatchedEnvironment(config, Observation(sensors, "flat"), [job.world for job in playing.values()])
        core.is_observing = self._drivers.driver is not None
        recorder = RolloutRecorder(core)
        try:
            beginning, seats = dict(playing), dict[int, _Slot]()
            while beginning or seats:
                seats |= self._begin(core, recorder, beginning)
                slots, beginning = np.array(list(seats)), {}
                is_over = recorder.is_over[slots]
                for slot in slots[is_over].tolist():
                    yield playing.pop(slot), recorder.rollout(slot)
                    del seats[slot]
                    job = next(waiting, None)
                    if job is not None:
                        playing[slot] = beginning[slot] = job
                    elif seats:
                        core.simulation.rest(slot)
                if is_over.any():
                    continue
                if self._drivers.driver is None and core.simulation.may_play:
                    recorder.play()
                else:
                    core.step_by_place(self._actions(core, seats))
                    recorder.add(slots)
        finally:
            core.close()

    def _begin(
        self, core: BatchedEnvironment, recorder: RolloutRecorder, jobs: Mapping[int, RolloutJob]
    ) -> dict[int, _Slot]:
        """Begin the episodes of jobs by slot; those with the same policies and start together."""
        seats, alike = dict[int, _Slot](), dict[tuple[int | None, ...], tuple[tuple[Policy, ...], list[int]]]()
        for slot, job in jobs.items():
            rng, driver = np.random.default_rng(job.seed), self._driver_of(slot)
            policies = tuple(policy.sampled(rng) for policy in self._drivers.policies)
            alike.setdefault((job.start, *map(id, policies)), (policies, []))[1].append(slot)
            if driver is not None and hasattr(driver, "reset"):
                driver.reset()
            if driver is not None and hasattr(driver, "seed"):
                driver.seed(rng)
            seats[slot] = _Slot(job, rng, driver)
        for (start, *_), (policies, slots) in alike.items():
            core.simulation.policies = policies
            core.begin(slots, [jobs[slot].world for slot in slots], start, is_observed=False)
        if jobs:
            core.simulation.observe_begun()
            for slot, job in jobs.items():
                recorder.begin(slot, job.world, job.num_steps, waits=job.waits)
            recorder.add(np.array(list(jobs)))
        return seats

    def _driver_of(self, slot: int) -> Driver | None:
        """Return the driver of a slot: its own, unless one drives batches, as drivers may remember their episode."""
        if self._batch_driver is not None:
            return self._batch_driver
        if self._drivers.driver is not None and slot not in self._drivers_by_slot:
            self._drivers_by_slot[slot] = self._drivers.make_driver()
        return self._drivers_by_slot.get(slot)

    def _actions(self, core: BatchedEnvironment, seats: Mapping[int, _Slot]) -> Float64:
        """Return the actions (C, 2) of all agents by place: zeros where a policy drives, and in slots that rest."""
        actions, driver = np.zeros((core.simulation.by_place.num_places, 2)), self._drivers.driver
        if driver is None:
            return actions
        core.simulation.observe()
        places = np.array(list(seats))  # each world has one agent
        for slot, seat in seats.items():
            seen = core.observe_by_place(seat.rng, np.array([slot]))
        if self._batch_driver is not None:
            actions[places] = _checked(self._batch_driver.act_batch(seen[places]), len(places))
            return actions
        for slot, seat in seats.items():
            if seat.driver is not None:
                actions[slot] = _checked(seat.driver.act(seen[slot]), 1)
        return actions


def _checked(actions: npt.ArrayLike, count: int) -> Float64:
    """Return the actions (count, 2) that a driver answers."""
    checked = checked_actions(actions)
    if len(checked) != count:
        raise BadParameter(f"{len(checked)} actions for {count} agents; return steering and throttle for each")
    return checked
