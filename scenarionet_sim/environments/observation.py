"""Observations of several sensors: one flat vector, or one array per sensor name."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import cached_property
from typing import Any, Literal

import numpy as np
from gymnasium import spaces

from scenarionet_data.arrays.dtypes import Array, Float32, Int32
from scenarionet_sim.sensors.base import Sensor
from scenarionet_sim.sensors.compiled import compiled_form
from scenarionet_sim.sensors.observation_kernels import Sensing
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world_batch import WorldBatch


class Observation:
    """Ordered sensors of an agent.

    Args:
        sensors: The sensors.
        form: ``flat`` or ``dict``.

    Attributes:
        names: Names of the sensors, from their classes: ``ego_state``, a second one ``ego_state_2``.
    """

    def __init__(self, sensors: Sequence[Sensor], form: Literal["flat", "dict"]) -> None:
        self._sensors = tuple(sensors)
        forms = [compiled_form(sensor) for sensor in self._sensors]
        self._numbers = np.array([number for number, form in enumerate(forms) if form is not None], np.intp)
        self._compiled = Sensing.of([form for form in forms if form is not None])
        self._uncompiled = [number for number, form in enumerate(forms) if form is None]
        self._sizes = [int(np.prod(sensor.shape)) for sensor in self._sensors]
        self._is_flat = form == "flat"
        self.names = _names(self._sensors)
        self._first: list[int] = []
        self._place, self._place_for = self._compiled.place, -1

    @cached_property
    def space(self) -> spaces.Space[Any]:
        """Observation space of one agent."""
        parts: dict[str, spaces.Space[Any]] = {
            name: sensor.space() for name, sensor in zip(self.names, self._sensors, strict=True)
        }
        if not self._is_flat:
            return spaces.Dict(parts)
        low, high = (np.concatenate([getattr(box, end).ravel() for box in parts.values()]) for end in ("low", "high"))
        return spaces.Box(low.astype(np.float32), high.astype(np.float32), dtype=np.float32)

    @property
    def is_compiled(self) -> bool:
        """Whether the compiled step writes the observations of all sensors."""
        return not self._uncompiled

    def of(self, batch: WorldBatch, state: State, agents: Int32, rng: np.random.Generator) -> Any:
        """Return new arrays with the observations of agents: (A, D) float32, or (A, ...) by name."""
        count = len(agents)
        seen = [sensor.observe(batch, state, agents, rng, sensor.empty(count)) for sensor in self._sensors]
        if self._is_flat:
            return np.concatenate(
                [part.reshape(count, size) for part, size in zip(seen, self._sizes, strict=True)],
                axis=1,
                dtype=np.float32,
            )
        return dict(zip(self.names, seen, strict=True))

    def allocate(self, num_agents: int) -> tuple[Any, Sensing]:
        """Return arrays for the observations of agents, of undefined values, and the compiled sensors' part of them."""
        if self._place_for != num_agents:
            sizes, place = np.array(self._sizes), self._compiled.place.copy()
            first = np.cumsum(sizes) - sizes
            stride = np.full_like(sizes, sizes.sum()) if self._is_flat else sizes
            first = first if self._is_flat else first * num_agents
            place[:, 0], place[:, 1] = first[self._numbers], stride[self._numbers]
            self._first, self._place, self._place_for = first.tolist(), place, num_agents
        size = sum(self._sizes)
        values = np.empty(num_agents * size, np.float32)
        if self._is_flat:
            observed: Any = values.reshape(num_agents, size)
        else:
            observed = {
                name: values[at : at + num_agents * size].reshape(num_agents, *sensor.shape)
                if sensor.dtype is np.float32
                else sensor.empty(num_agents)
                for name, sensor, at, size in zip(self.names, self._sensors, self._first, self._sizes, strict=True)
            }
        return observed, self.writing(values)

    def writing(self, values: Float32) -> Sensing:
        """Return the compiled sensors that write to an array for as many agents as :meth:`allocate` was called for."""
        return self._compiled._replace(place=self._place, out=values)

    def complete(
        self, observed: Any, batch: WorldBatch, state: State, agents: Int32, rng: np.random.Generator, rows: Array
    ) -> None:
        """Write the observations of the sensors that are not part of the compiled step.

        Args:
            observed: As :meth:`allocate` returns them.
            batch, state, agents, rng: As :meth:`Sensor.observe` takes them.
            rows: (A,) rows of the agents in the arrays.
        """
        ends = np.cumsum(self._sizes)
        for number in self._uncompiled:
            sensor, size, end = self._sensors[number], self._sizes[number], ends[number]
            seen = sensor.observe(batch, state, agents, rng, sensor.empty(len(agents)))
            if self._is_flat:
                observed[rows, end - size : end] = seen.reshape(len(agents), size)
            else:
                observed[self.names[number]][rows] = seen

    def write(self, observed: Any, other: Any) -> None:
        """Write observations to other arrays."""
        if self._is_flat:
            other[:] = observed
        else:
            for name, values in observed.items():
                other[name][:] = values

    def split(self, observed: Any) -> list[Any]:
        """Split a batch into one observation per agent."""
        if self._is_flat:
            return list(observed)
        agents = range(len(observed[self.names[0]]))
        return [{name: values[agent] for name, values in observed.items()} for agent in agents]

    def take(self, observed: Any, rows: Array) -> Any:
        """Copy the observations of some agents."""
        return observed[rows] if self._is_flat else {name: values[rows] for name, values in observed.items()}

    def parts(self, observed: Array) -> dict[str, Array]:
        """Return the arrays (..., *shape) by sensor of flat observations (..., D)."""
        ends = np.cumsum(self._sizes)
        return {
            name: observed[..., end - size : end].reshape(*observed.shape[:-1], *sensor.shape)
            for name, sensor, size, end in zip(self.names, self._sensors, self._sizes, ends, strict=True)
        }


def _names(sensors: Sequence[Sensor]) -> list[str]:
    names: list[str] = []
    for sensor in sensors:
        name = re.sub(r"(?<!^)(?=[A-Z])", "_", type(sensor).__name__).lower()
        count = sum(other == name or other.startswith(f"{name}_") for other in names)
        names.append(f"{name}_{count + 1}" if count else name)
    return names
