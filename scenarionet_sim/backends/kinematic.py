"""Kinematic backend: bicycle model without collision response; contacts are still detected."""

from __future__ import annotations

from dataclasses import astuple, dataclass, field

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Bool, Float64, Int32
from scenarionet_data.errors import BadParameter
from scenarionet_data.scenario.settings import Count, Positive, check_settings
from scenarionet_sim.arrays.structures import OBJECTS
from scenarionet_sim.backends.base import SUBSTEPS, Drive
from scenarionet_sim.backends.bicycle_kernels import GRIP, MAX_STEER, NUM_COLUMNS, STEER_RATE, WHEELBASE, drive_bicycles
from scenarionet_sim.backends.fleet import Fleet
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world_batch import WorldBatch


@dataclass(frozen=True)
class Kinematic:
    """A kinematic bicycle model for any number of worlds and agents in one call.

    Attributes:
        drive: What vehicles are capable of: the same for all, or ``Fleet()`` for limits by class and size.
        grip: Radius of the friction circle [m/s²], of all vehicles that have the same ``Drive``; what engine, brakes
            and bend ask for beyond is cut to it. A world with less friction has less of it.
        substeps: Physics steps per control step.
    """

    drive: Drive | Fleet = field(default_factory=Drive)
    grip: Positive = 8.0
    substeps: Count = SUBSTEPS

    def __post_init__(self) -> None:
        check_settings(self)
        if not isinstance(self.drive, Drive | Fleet):
            raise BadParameter(f"drive={self.drive!r}; expected a Drive, or Fleet()")

    def open(self, batch: WorldBatch) -> KinematicSession:
        """Open a session."""
        return KinematicSession(self, batch)


class KinematicSession:
    """Vehicles of W worlds; the compiled step drives by ``vehicles`` and ``substeps`` itself.

    Attributes:
        vehicles: (W, N, NUM_COLUMNS) see ``backends.bicycle_kernels``.
        substeps: Physics steps per control step.
        new_vehicle: (NUM_COLUMNS,) every vehicle at the beginning of an episode; empty for a fleet of several.
    """

    def __init__(self, backend: Kinematic, batch: WorldBatch) -> None:
        self._batch = batch
        self.substeps = backend.substeps
        self._fleet = backend.drive if isinstance(backend.drive, Fleet) else None
        drive = backend.drive.car if isinstance(backend.drive, Fleet) else backend.drive
        row = _columns(np.array([(*astuple(drive), backend.grip)]))[0]
        self.new_vehicle: Float64 = row if self._fleet is None else row[:0]
        self.vehicles: Float64 = np.empty((len(batch), batch.max_objects, NUM_COLUMNS))
        self._is_reset: Bool = np.zeros(len(batch), np.bool_)  # the vehicles of the others take no memory

    def make_room(self, num_objects: int) -> None:
        """Make room for the vehicles of a larger world."""
        missing = num_objects - self.vehicles.shape[1]
        if missing > 0:
            self.vehicles = np.pad(self.vehicles, ((0, 0), (0, missing), (0, 0)))

    def reset(self, world: int, state: State) -> None:
        """Set the vehicles of a world: wheels straight, limits of their classes."""
        self.make_room(state.present.shape[1])
        self._is_reset[world] = True
        count = self._batch.num_objects[world]
        if self._fleet is None:
            self.vehicles[world, :count] = self.new_vehicle
        else:
            of_objects = self._fleet.numbers(state.object_type[world, :count], state.size[world, :count])
            self.vehicles[world, :count] = _columns(of_objects)
        first = self._batch.place[world, OBJECTS]
        self.vehicles[world, :count, GRIP] *= self._batch.recorded.friction[first : first + count]

    def drive(self, state: State, agents: Int32, actions: Float64, dt: float) -> None:
        """Move the agents by one control step, in place; see :class:`scenarionet_sim.backends.base.Session`."""
        for world in np.unique(agents[~self._is_reset[agents[:, 0]], 0]).tolist():
            self.reset(world, state)
        drive_bicycles(agents, actions, dt, self.substeps, self.vehicles, state.size, state.motion)

    def close(self) -> None:
        """Do nothing: the session holds no resources."""


def _columns(numbers: Array) -> Float64:
    """Return rows (N, NUM_COLUMNS) of the kernel for the numbers of ``Drive`` and the grip (N, 10)."""
    rows = np.zeros((len(numbers), NUM_COLUMNS))
    rows[:, MAX_STEER : WHEELBASE + 1] = numbers[:, :5]
    rows[:, GRIP] = numbers[:, -1]
    rows[:, STEER_RATE : STEER_RATE + 4] = numbers[:, 5:-1]
    return rows
