"""What an episode adds up to while it runs: crashes, speed, distance from the recording, for every agent."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.compiled import kernel
from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Int32, Int64, UInt8
from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_sim.kernels.log import VALID, X, Y
from scenarionet_sim.kernels.minmax import larger

COLUMNS = (
    "cost",
    "vehicle_crashes",
    "human_crashes",
    "object_crashes",
    "speed",
    "mean_speed",
    "distance_to_log",
    "mean_distance_to_log",
)
"""Columns of ``Tally.board``: see :func:`count`."""

_VEHICLE, _HUMANS = int(ObjectType.VEHICLE), (int(ObjectType.PEDESTRIAN), int(ObjectType.CYCLIST))
_STEPS, _SPEED, _LOG_STEPS, _LOG_DISTANCE = range(4)


@dataclass(eq=False)
class Tally:
    """Counts of an episode, of every object that may be an agent.

    Attributes:
        crashes: (W, N, 3) int64 vehicles, humans and other objects run into.
        sums: (W, N, 4) float64 steps, speeds, steps with a recorded place, distances from it.
    """

    crashes: Int64
    sums: Float64

    @classmethod
    def of(cls, num_worlds: int, num_objects: int) -> Tally:
        """All zero."""
        return cls(np.zeros((num_worlds, num_objects, 3), np.int64), np.zeros((num_worlds, num_objects, 4)))

    def begin(self, slot: int, num_objects: int) -> None:
        """Zero for a world; room for as many objects."""
        more = num_objects - self.sums.shape[1]
        if more > 0:
            self.crashes = np.pad(self.crashes, ((0, 0), (0, more), (0, 0)))
            self.sums = np.pad(self.sums, ((0, 0), (0, more), (0, 0)))
        self.crashes[slot], self.sums[slot] = 0, 0.0


@kernel
def count(
    agents: Int32,
    position: Float64,
    velocity: Float64,
    object_type: UInt8,
    timestep: Int32,
    num_steps: Int32,
    log: Float32,
    contacts: Bool,
    contacts_before: Bool,
    crashes: Int64,
    sums: Float64,
    board: Float64,
) -> None:
    """Add a step.

    A crash begins where an agent touches what it did not touch a step ago. Distance from the recording is taken
    at the timesteps at which the agent was recorded, in the plane.

    Args:
        agents: (A, 2) world and row.
        position, velocity, object_type, timestep: See ``State``.
        num_steps, log: See ``WorldBatch``.
        contacts, contacts_before: (A, N) what each agent touches, now and a step ago.
        crashes, sums: See ``Tally``; added to.
        board: (A, 8) written: crashes that begin now; crashes so far into vehicles, humans and objects; speed now
            and on average [m/s]; distance from the recording, last known and on average [m].
    """
    for a in range(len(agents)):
        w, n = agents[a, 0], agents[a, 1]
        begun = 0
        for m in range(contacts.shape[1]):
            if contacts[a, m] and not contacts_before[a, m]:
                begun += 1
                kind = object_type[w, m]
                crashes[w, n, 0 if kind == _VEHICLE else (1 if kind in _HUMANS else 2)] += 1
        speed = np.hypot(velocity[w, n, 0], velocity[w, n, 1])
        total = sums[w, n]
        total[_STEPS] += 1.0
        total[_SPEED] += speed
        t = timestep[w]
        if t < num_steps[w] and log[w, t, n, VALID] != 0:
            apart = np.hypot(position[w, n, 0] - log[w, t, n, X], position[w, n, 1] - log[w, t, n, Y])
            total[_LOG_STEPS] += 1.0
            total[_LOG_DISTANCE] += apart
            board[a, 6] = apart
        board[a, 0] = begun
        for kind in range(3):
            board[a, 1 + kind] = crashes[w, n, kind]
        board[a, 4] = speed
        board[a, 5] = total[_SPEED] / total[_STEPS]
        board[a, 7] = total[_LOG_DISTANCE] / larger(total[_LOG_STEPS], 1.0)
