"""What all environments share: a seeded series of scenarios, played in the slots of one batched environment."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.error import ResetNeeded
from gymnasium.utils import seeding

from scenarionet_data.arrays.dtypes import Bool, Int64, IntP, is_count
from scenarionet_data.arrays.memory import release_unused
from scenarionet_data.errors import BadParameter, ScenarioNetError
from scenarionet_sim.arrays.structures import Series
from scenarionet_sim.environments.batched import BatchedEnvironment
from scenarionet_sim.environments.config import EnvConfig
from scenarionet_sim.environments.observation import Observation
from scenarionet_sim.scenarios.sampling import CurriculumSampler
from scenarionet_sim.scenarios.stream import ScenarioStream
from scenarionet_sim.simulation.seats import Seats
from scenarionet_sim.worlds.world import World


def action_space() -> spaces.Box:
    """Return the space of steering (positive left) and throttle (negative: brake)."""
    return spaces.Box(-1.0, 1.0, (2,), np.float32)


class Episodes:
    """A series of scenarios, and the batched environment that plays them.

    Args:
        config: Configuration.
        seed: Seed of the series unless ``restart`` gets one; None for a random one.
        num_slots: Number of worlds; they draw from one series.
        prefetch: Number of scenarios to load ahead; None for that of ``config``.
        threads: Largest number of threads.

    Attributes:
        observation: Sensors of the agents.
        seats: Flat buffers for the results of the agents, if they are set before the first world is played.
        rng: Source of the sensors' noise.
        seed: Seed of the series; None before the first ``restart`` of a random one.
        was_played: (number of scenarios,) bool scenarios that were drawn so far.
        skipped: Why scenarios could not be read, and how often they were drawn, by id; see ``draw_all``.
    """

    def __init__(
        self,
        config: EnvConfig,
        seed: int | None,
        num_slots: int = 1,
        prefetch: int | None = None,
        threads: int = 1,
    ) -> None:
        if not is_count(threads, 1):
            raise BadParameter(f"threads={threads!r}; expected a number of threads, or 0 for all cores")
        self.config, self.seed, self._threads = config, seed, threads
        self.observation = Observation(config.sensors, config.observation)
        loader, self._sampler = config.scenarios.open()
        self.ids = loader.scenario_ids
        self._stream = ScenarioStream(
            self.ids, loader.__getitem__, partial(World.from_scenario, dt=config.dt), self._sampler,
            prefetch=config.prefetch if prefetch is None else prefetch, cache_size=config.cache_size,
        )  # fmt: skip
        self.was_played: Bool = np.zeros(len(self.ids), np.bool_)
        self.skipped: dict[str, tuple[str, int]] = {}
        self.seats: Seats | None = None
        self._is_fresh = True
        self._core: BatchedEnvironment | None = None
        self._series = Series(np.zeros(num_slots, np.int64), self.was_played, np.zeros((len(self.ids), 2), np.int64))

    @property
    def is_adaptive(self) -> bool:
        """Whether the series depends on the results of episodes, which are to be reported."""
        return self._sampler.is_adaptive

    @property
    def playing(self) -> Int64:
        """(W,) scenario of each slot."""
        return self._series.playing

    def restart(self, seed: int | None) -> bool:
        """Restart the series, if a seed is given or on the first call; return whether it restarted."""
        if seed is None and not self._is_fresh:
            return False
        seed = self.seed if seed is None else seed
        if seed is not None and not is_count(seed):
            raise BadParameter(f"seed={seed!r}; expected a whole number that is not negative, or None")
        self.rng, self.seed = seeding.np_random(None if seed is None else int(seed))
        self._stream.restart(self.seed)
        self._is_fresh = False
        return True

    def state(self) -> dict[str, Any]:
        """Return where the series stands, JSON-serialisable: also what each slot plays, and the noise."""
        return {
            "seed": self.seed,
            "stream": self._stream.state(),
            "playing": self.playing.tolist(),
            "played": np.flatnonzero(self.was_played).tolist(),
            "noise": self.rng.bit_generator.state,
        }

    def restore(self, state: Mapping[str, Any]) -> list[World]:
        """Continue where other episodes of the same scenarios stood; return the world that each slot plays.

        Raises:
            LakeError: A scenario cannot be read.
        """
        self.restart(state["seed"])
        self._stream.restore(state["stream"])
        self.rng.bit_generator.state = state["noise"]
        self.playing[:], self.was_played[:] = state["playing"], False
        self.was_played[state["played"]] = True
        worlds = {index: self._world(index) for index in np.unique(self.playing).tolist()}
        return [worlds[index] for index in self.playing.tolist()]

    def chosen(self, options: Mapping[str, Any] | None) -> tuple[World, int | None]:
        """Return the world and the timestep to begin with, by the options of ``reset``.

        Raises:
            BadParameter: An option is unknown or of another type.
            ScenarioNotFound: The id is not among the selected scenarios.
            LakeError: The scenario cannot be read.
        """
        options = {} if options is None else options
        if not isinstance(options, Mapping) or not options.keys() <= {"scenario_id", "timestep"}:
            raise BadParameter(
                f"options={options!r}; expected {{'scenario_id': 'pg/v2/3', 'timestep': 0}} or one of them"
            )
        timestep = options.get("timestep")
        if timestep is not None and not is_count(timestep, None):
            raise BadParameter(f"timestep={timestep!r}; expected a whole number")
        return self.draw(scenario_id=options.get("scenario_id")), timestep

    def draw(self, slot: int = 0, scenario_id: str | None = None) -> World:
        """Return the world to play in a slot: the next of the series, or a given one.

        Raises:
            ScenarioNotFound: The id is not among the selected scenarios.
            LakeError: The scenario cannot be read; the next draw continues with the one after it.
        """
        if scenario_id is None:
            return self._draw_next(slot, {})
        self.playing[slot] = index = self._stream.index(scenario_id)
        return self._world(index)

    def draw_all(self, slots: IntP, *, skips: bool = False) -> list[World]:
        """Return the worlds to play in some slots: the next of the series, of each scenario one.

        Args:
            slots: The slots.
            skips: Skip scenarios that cannot be read, and note them in ``skipped``.

        Raises:
            ScenarioNetError: A scenario cannot be read, or none of as many as there are if those are skipped; this is
                the last one's error.
        """
        draw = self._draw_playable if skips else self._draw_next
        drawn: dict[int, World] = {}
        return [draw(slot, drawn) for slot in slots.tolist()]

    def begin(self, slots: IntP, worlds: list[World]) -> BatchedEnvironment:
        """Begin the episodes of worlds that were drawn for some slots; return the environment that plays them."""
        is_new, core = self._core is None, self.prepare(worlds)
        core.begin(slots, worlds)
        core.simulation.batch.note(slots, self.playing[slots], self._series)
        if is_new:
            release_unused()  # the memory of what was copied from the worlds
        return core

    def begin_next(self, slots: IntP, *, in_step: bool = False, skips: bool = False) -> None:
        """Begin the next scenarios of the series in some slots.

        Args:
            slots: The slots.
            in_step: In the next step, instead of now; their worlds do not move in it.
            skips: See :meth:`draw_all`.

        Raises:
            ScenarioNetError: See :meth:`draw_all`.
        """
        simulation, stream, series, count = self.core.simulation, self._stream, self._series, len(slots)
        num_unknown = simulation.begin_known(slots, stream.coming(count), series)
        if num_unknown >= 0:
            stream.take(count)
            if num_unknown:
                stream.load_ahead(self._is_stored)
        else:
            simulation.begin(slots, self.draw_all(slots, skips=skips))
            simulation.batch.note(slots, series.playing[slots], series)
        if not in_step:
            simulation.observe_begun()

    def _draw_next(self, slot: int, drawn: dict[int, World]) -> World:
        """Return the world of the next scenario of the series, which is added to those that are ``drawn`` already."""
        self.playing[slot] = index = self._stream.draw()
        self.was_played[index] = True
        if index not in drawn:
            drawn[index] = self._world(index)
        self._stream.load_ahead(self._is_stored)
        return drawn[index]

    def _world(self, index: int) -> World:
        """Return the world of a scenario: one that the simulation has stored, or another one."""
        return self._stored_world(index) or self._stream.get(index)

    def _draw_playable(self, slot: int, drawn: dict[int, World]) -> World:
        """Return the world of the next scenario of the series that can be read; note the others in ``skipped``."""
        for _ in range(len(self.ids) - 1):
            try:
                return self._draw_next(slot, drawn)
            except ScenarioNetError as error:
                scenario_id = self.ids[int(self.playing[slot])]
                reason, count = self.skipped.get(scenario_id, (str(error), 0))
                self.skipped[scenario_id] = reason, count + 1
        return self._draw_next(slot, drawn)

    def prepare(self, worlds: list[World]) -> BatchedEnvironment:
        """Return the environment for these worlds."""
        if self._core is None:
            self._series.known[:] = 0
            self._core = BatchedEnvironment(self.config, self.observation, worlds, self._threads, self.seats)
        return self._core

    def report(self, slot: int, success: float) -> None:
        """Report the result of a slot's episode: 1 for success, 0 for failure, or the share of successful agents."""
        self._sampler.report(int(self.playing[slot]), success)

    def _stored_world(self, index: int) -> World | None:
        """Return the world of a scenario that the simulation has stored."""
        return self._core.simulation.batch.known(index, self._series) if self._core is not None else None

    def _is_stored(self, index: int) -> bool:
        return self._stored_world(index) is not None

    def observed(self) -> list[Any]:
        """Return a new observation of each agent."""
        return self.observation.split(self.core.observe(self.rng))

    def close(self) -> None:
        """Stop the thread and the physics; the next episode starts them again."""
        self._stream.close()
        if self._core is not None:
            self._core.close()
            self._core = None

    @property
    def level(self) -> int | None:
        """Level of the curriculum, from 0; None without one."""
        return self._sampler.level if isinstance(self._sampler, CurriculumSampler) else None

    @property
    def core(self) -> BatchedEnvironment:
        """The batched environment.

        Raises:
            ResetNeeded: ``reset`` was not called yet, or the environment is closed.
        """
        if self._core is None:
            raise ResetNeeded("there is no world yet; call reset first")
        return self._core
