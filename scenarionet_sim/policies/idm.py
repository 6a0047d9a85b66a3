"""Traffic that reacts, on the paths it was recorded on."""

from __future__ import annotations

from dataclasses import dataclass

from scenarionet_data.arrays.dtypes import Bool, UInt8
from scenarionet_data.errors import BadParameter
from scenarionet_data.scenario.vocabulary import LIGHT_COLORS
from scenarionet_sim.kernels.idm import Law, drive_along_paths
from scenarionet_sim.policies.base import Policy
from scenarionet_sim.policies.objects import ObjectMask, other_vehicles
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world import World
from scenarionet_sim.worlds.world_batch import WorldBatch


@dataclass(frozen=True)
class Idm(Policy):
    """The Intelligent Driver Model (Treiber, Hennecke, Helbing 2000) along an object's recorded path.

    It keeps headway to whatever reaches into the strip ahead, the ego too, stops at red lights on the lanes that
    its path follows, slows down for bends, and leaves at the end of its path. It appears as recorded, as soon as
    its place is free. Objects that were recorded standing are left to the policy before this one.

    Attributes:
        objects: Which objects; ``Idm(objects=ego)`` is a driver for the ego.
        headway: Time gap to the object ahead [s].
        acceleration: [m/s2]
        deceleration: Comfortable braking [m/s2].
        standstill: Gap at rest [m].
        slowest: Desired speed of an object that was recorded slower than this; otherwise the highest recorded [m/s].
        lateral: Sideways acceleration in bends [m/s2].
        overlap: What reaches less far than this into the strip is passed [m]: recorded boxes are not that exact.
        hardest: Braking in an emergency [m/s2].
        shortest: Objects with a shorter path stand [m].
    """

    objects: ObjectMask = other_vehicles
    headway: float = 1.5
    acceleration: float = 2.0
    deceleration: float = 3.0
    standstill: float = 2.0
    slowest: float = 5.0
    lateral: float = 3.0
    overlap: float = 0.3
    hardest: float = 8.0
    shortest: float = 2.0

    def __post_init__(self) -> None:
        for number in ("headway", "acceleration", "deceleration", "standstill", "slowest", "lateral", "hardest"):
            if not getattr(self, number) > 0.0:
                raise BadParameter(f"Idm: {number} is {getattr(self, number)}; it must be positive")

    def wants(self, world: World) -> Bool:
        """Those of its objects that drive at all."""
        return self.objects(world) & (world.paths.length() >= self.shortest)

    def advance(self, batch: WorldBatch, now: State, then: State, driver: UInt8, me: int, dt: float) -> None:
        """One step of the law for each."""
        law = Law(
            self.headway, self.acceleration, self.deceleration, self.standstill,
            self.slowest, self.lateral, self.overlap, self.hardest,
        )  # fmt: skip
        paths = batch.path_points, batch.path_arc, batch.path_heading, batch.path_z, batch.path_offsets
        stops = batch.stop_arc, batch.stop_light, batch.stop_offsets, batch.light_state
        moments = *now.motion, now.arc, *then.motion, then.arc, then.lateral
        drive_along_paths(
            driver, me, dt, law, LIGHT_COLORS, batch.log, batch.num_steps, now.timestep,
            *paths, batch.top_speed, *stops, now.size, *moments,
        )  # fmt: skip
