"""Observations of several sensors: one flat vector, or one array per sensor name."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from gymnasium import spaces

from scenarionet_data.arrays.dtypes import Array, Int32
from scenarionet_sim.sensors.base import Sensor
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world_batch import WorldBatch


class Observation:
    """Ordered sensors of an agent.

    Args:
        sensors: The sensors.
        form: ``flat`` or ``dict``.

    Attributes:
        names: Names of the sensors, from their classes: ``ego_state``, a second one ``ego_state_2``.
        space: Observation space of one agent.
    """

    def __init__(self, sensors: Sequence[Sensor], form: Literal["flat", "dict"]) -> None:
        self._sensors = tuple(sensors)
        self._sizes = [int(np.prod(sensor.shape)) for sensor in self._sensors]
        self._is_flat = form == "flat"
        self.names = _names(self._sensors)
        parts: dict[str, spaces.Space[Any]] = {
            name: sensor.space() for name, sensor in zip(self.names, self._sensors, strict=True)
        }
        self.space: spaces.Space[Any] = (
            _joined([sensor.space() for sensor in self._sensors]) if self._is_flat else spaces.Dict(parts)
        )

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

    def split(self, observed: Any) -> list[Any]:
        """Split a batch into one observation per agent."""
        if self._is_flat:
            return list(observed)
        agents = range(len(observed[self.names[0]]))
        return [{name: values[agent] for name, values in observed.items()} for agent in agents]

    def take(self, observed: Any, rows: Array) -> Any:
        """Copy the observations of some agents."""
        return observed[rows] if self._is_flat else {name: values[rows] for name, values in observed.items()}

    def put(self, observed: Any, rows: Array, others: Any) -> None:
        """Overwrite the observations of some agents."""
        if self._is_flat:
            observed[rows] = others
        else:
            for name, values in observed.items():
                values[rows] = others[name]

    def parts(self, observed: Array) -> dict[str, Array]:
        """Return the arrays (..., *shape) by sensor of flat observations (..., D)."""
        ends = np.cumsum(self._sizes)
        return {
            name: observed[..., end - size : end].reshape(*observed.shape[:-1], *sensor.shape)
            for name, sensor, size, end in zip(self.names, self._sensors, self._sizes, ends, strict=True)
        }


def _joined(parts: list[spaces.Box]) -> spaces.Box:
    low, high = (np.concatenate([end.ravel() for end in ends]) for ends in zip(*map(_bounds, parts), strict=True))
    return spaces.Box(low.astype(np.float32), high.astype(np.float32), dtype=np.float32)


def _bounds(box: spaces.Box) -> tuple[Array, Array]:
    return box.low, box.high


def _names(sensors: Sequence[Sensor]) -> list[str]:
    names: list[str] = []
    for sensor in sensors:
        name = re.sub(r"(?<!^)(?=[A-Z])", "_", type(sensor).__name__).lower()
        count = sum(other == name or other.startswith(f"{name}_") for other in names)
        names.append(f"{name}_{count + 1}" if count else name)
    return names
