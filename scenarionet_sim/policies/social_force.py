"""Pedestrians and cyclists that react."""

from __future__ import annotations

from dataclasses import dataclass

from scenarionet_data.arrays.dtypes import UInt8
from scenarionet_data.scenario.settings import Positive
from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_sim.policies.base import Policy
from scenarionet_sim.policies.objects import ObjectMask, OfType
from scenarionet_sim.policies.walking_kernels import ForceLaw, walk
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world_batch import WorldBatch

pedestrians_and_cyclists = OfType((ObjectType.PEDESTRIAN, ObjectType.CYCLIST))


@dataclass(frozen=True)
class SocialForce(Policy):
    """The social force model (Helbing and Molnár 1995) on top of the recorded way.

    An object goes as recorded, gives way to others and to vehicles about to drive over its place, and returns to where
    the recording is. It is present while it was recorded. ``strength``, ``reach`` and ``behind`` are those of the
    paper, whose potential of 2.1 m²/s² with a range of 0.3 m is a force of 7 m/s².

    Attributes:
        objects: Selects the objects.
        relaxation: Time in which it takes on its desired velocity [s].
        return_time: Time in which it wants to be back at the recorded position [s].
        strength, reach: Repulsion from others at contact [m/s²], and the distance in which it falls by 1/e [m].
        vehicle_strength, vehicle_reach: The same from vehicles.
        look_ahead: Time of a vehicle's motion that its strip covers [s].
        behind: Weight of what is behind, 0 to 1; that of what is straight ahead is 1.
        hurry: Largest speed as a multiple of the highest recorded one, of at least 1 m/s.
        horizon: Others further away than this many reaches are ignored.
    """

    objects: ObjectMask = pedestrians_and_cyclists
    relaxation: Positive = 0.5
    return_time: Positive = 2.0
    strength: float = 7.0
    reach: Positive = 0.3
    vehicle_strength: float = 10.0
    vehicle_reach: Positive = 0.8
    look_ahead: float = 1.0
    behind: float = 0.5
    hurry: Positive = 1.3
    horizon: float = 8.0

    def advance(self, batch: WorldBatch, now: State, then: State, driver: UInt8, policy_id: int, dt: float) -> None:
        """Write the next state of its objects, in a kernel of its own."""
        law = ForceLaw(*(float(getattr(self, name)) for name in ForceLaw._fields))
        walk(batch.recorded, now.moment, then.moment, driver, policy_id, dt, law)
