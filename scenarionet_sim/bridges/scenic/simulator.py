"""Scenic's interface to a simulator, over :class:`~scenarionet_sim.simulation.simulation.Simulation`.

A scene is a scenario of two equal timesteps. Cars are agents of the backend; pedestrians and all other objects carry on
with the velocity that a behaviour gives them. Scenic's headings are counted from the y axis.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from scenic.core.simulators import SimulationCreationError
from scenic.core.vectors import Vector
from scenic.domains.driving.actions import Steers, Walks
from scenic.domains.driving.simulators import DrivingSimulation, DrivingSimulator

from scenarionet_data.arrays.dtypes import Bool, Float64
from scenarionet_data.building.tracks import make_tracks
from scenarionet_data.codec.lights import no_lights
from scenarionet_data.converters.formats.map_files import read_map
from scenarionet_data.scenario.description import MapFeatures, ScenarioDescription, Source
from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_sim.arrays.log import HEADING, VX, VY, YAW_RATE, X, Z
from scenarionet_sim.backends.base import CONTROL_STEP, Backend
from scenarionet_sim.policies.constant_velocity import ConstantVelocity
from scenarionet_sim.policies.external import External
from scenarionet_sim.simulation.simulation import Simulation
from scenarionet_sim.worlds.world import World

_NORTH = 0.5 * math.pi


@dataclass(frozen=True)
class SceneRows:
    """Selects objects by their rows.

    Attributes:
        rows: The rows.
    """

    rows: tuple[int, ...]

    def __call__(self, world: World) -> Bool:
        """Return (N,) whether each object is one of them."""
        return np.isin(np.arange(world.num_objects), self.rows)


class ScenarioNetSimulator(DrivingSimulator):
    """Simulates scenes of Scenic.

    Args:
        map_file: OpenDRIVE file of the road.
        backend: Vehicle dynamics; None for ``Kinematic()``.
    """

    def __init__(self, map_file: str | Path, backend: Backend | None = None) -> None:
        super().__init__()
        self._map_file, self._backend = Path(map_file), backend

    def createSimulation(self, scene: Any, *, timestep: float | None, **options: Any) -> ScenarioNetSimulation:  # noqa: N802 - Scenic's name
        """Begin the simulation of a scene."""
        return ScenarioNetSimulation(
            scene, features_of(self._map_file), self._backend, timestep=timestep or CONTROL_STEP, **options
        )


class ScenarioNetSimulation(DrivingSimulation):
    """A scene that is simulated.

    Attributes:
        simulation: The simulation of the only world, whose objects are in the order of the scene.
        touched: Names of pairs that the cars have touched, as Scenic's objects.
    """

    def __init__(self, scene: Any, features: MapFeatures, backend: Backend | None, **options: Any) -> None:
        self._features, self._backend = features, backend
        self._row: dict[Any, int] = {}
        self.simulation: Simulation | None = None
        self.touched: set[tuple[Any, Any]] = set()
        super().__init__(scene, **options)

    def setup(self) -> None:
        """Create all objects, and the world of them."""
        super().setup()
        cars = tuple(row for obj, row in self._row.items() if isinstance(obj, Steers))
        others = tuple(row for row in self._row.values() if row not in cars)
        policies = ConstantVelocity(SceneRows(others)), External(SceneRows(cars))
        world = World.from_scenario(self._scenario(), self.timestep)
        self.simulation = Simulation([world], policies, self._backend)

    def createObjectInSimulator(self, obj: Any) -> None:  # noqa: N802 - Scenic's name
        """Note an object of the scene; those that appear later are refused."""
        if self.simulation is not None:
            raise SimulationCreationError("objects that appear during a simulation are not supported")
        self._row[obj] = len(self._row)

    def step(self) -> None:
        """Give the objects what their behaviours ask for, and advance by a timestep."""
        if self.simulation is None:
            raise SimulationCreationError("no objects")
        motion, cars = self.simulation.state.motion[0], list(self._row)
        for obj, row in self._row.items():
            if (position := vars(obj).pop("given_position", None)) is not None:
                motion[row, X : Z + 1] = tuple(position)
            if (velocity := vars(obj).pop("given_velocity", None)) is not None:
                motion[row, VX : VY + 1] = tuple(velocity)[:2]
            if isinstance(obj, Walks) and not (obj.walking_heading is obj.walking_speed is None):
                heading = motion[row, HEADING]
                if obj.walking_heading is not None:
                    heading = motion[row, HEADING] = obj.walking_heading + _NORTH
                speed = np.hypot(*motion[row, VX : VY + 1]) if obj.walking_speed is None else obj.walking_speed
                motion[row, VX : VY + 1] = speed * math.cos(heading), speed * math.sin(heading)
        agents = [cars[row] for _, row in self.simulation.agents.tolist()]
        self.simulation.step(np.array([action_of(obj) for obj in agents]).reshape(-1, 2))
        for obj, contacts in zip(agents, self.simulation.contacts, strict=True):
            self.touched |= {(obj, cars[row]) for row in np.flatnonzero(contacts[: len(cars)]).tolist()}

    def getProperties(self, obj: Any, properties: set[str]) -> dict[str, Any]:  # noqa: N802 - Scenic's name
        """Return what Scenic asks for of an object."""
        if self.simulation is None:
            raise SimulationCreationError("no objects")
        row = self.simulation.state.motion[0, self._row[obj]]
        yaw, _, _ = obj.parentOrientation.globalToLocalAngles(float(row[HEADING]) - _NORTH, 0, 0)
        found = {
            "position": Vector(*row[X : Z + 1].tolist()),
            "yaw": yaw,
            "pitch": 0,
            "roll": 0,
            "velocity": Vector(float(row[VX]), float(row[VY]), 0),
            "speed": float(np.hypot(row[VX], row[VY])),
            "angularSpeed": float(row[YAW_RATE]),
            "angularVelocity": Vector(0, 0, float(row[YAW_RATE])),
        }
        return found | ({"elevation": float(row[Z])} if "elevation" in properties else {})

    def destroy(self) -> None:
        """Release the simulation."""
        if self.simulation is not None:
            self.simulation.close()
        super().destroy()

    def _scenario(self) -> ScenarioDescription:
        """The scene as a scenario."""
        objects = list(self._row)
        states: Float64 = np.array([[*obj.position, obj.heading + _NORTH, *tuple(obj.velocity)[:2]] for obj in objects])
        twice = np.repeat(states[:, None], 2, axis=1)
        tracks = make_tracks(
            [f"{row}" for row in self._row.values()],
            [object_type_of(obj) for obj in objects],
            twice[..., :3],
            twice[..., 3],
            twice[..., 4:],
            np.array([[obj.length, obj.width, obj.height] for obj in objects]),
            np.ones(twice.shape[:2], np.bool_),
            origin=np.zeros(3),
        )
        return ScenarioDescription(
            id="scenic/scene/0", dataset="scenic", version="scene", split="test", dt=self.timestep,
            timestamps=np.arange(2) * self.timestep, current_timestep=0, ego_id="0", has_z=False, origin=np.zeros(3),
            source=Source("scene", "", "of the program"), tracks=tracks, lights=no_lights(2), map=self._features,
        )  # fmt: skip


def object_type_of(obj: Any) -> ObjectType:
    """Return the type of an object of Scenic."""
    if isinstance(obj, Walks):
        return ObjectType.PEDESTRIAN
    return ObjectType.VEHICLE if getattr(obj, "isVehicle", False) else ObjectType.OTHER


def action_of(car: Any) -> tuple[float, float]:
    """Return steering, positive left, and throttle of a car: Scenic steers to the right."""
    brake = 1.0 if car.hand_brake else float(car.brake)
    return -float(car.steer), -brake if brake > 0.0 else float(car.throttle)


@lru_cache(maxsize=2)
def features_of(map_file: Path) -> MapFeatures:
    """Return the features of a map."""
    return read_map(map_file).build(np.zeros(3), has_z=False)
