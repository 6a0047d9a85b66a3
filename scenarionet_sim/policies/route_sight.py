"""Sensors of the traffic on an agent's own route; and what a driver model would do there, which learners imitate."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Int32
from scenarionet_data.scenario.settings import Count, Positive
from scenarionet_data.scenario.vocabulary import LIGHT_COLORS
from scenarionet_sim.backends.base import Drive
from scenarionet_sim.policies.idm import Idm
from scenarionet_sim.policies.route_sight_kernels import LEADER, guide, observe_leaders
from scenarionet_sim.policies.strip_kernels import SightMemory
from scenarionet_sim.sensors.base import Sensor, require_located
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world_batch import WorldBatch


@dataclass(frozen=True)
class RouteTraffic(Sensor):
    """Cruising speed, the way that is left, and the objects on the strip that the agent will sweep along its route.

    Observes (2 + 3 objects,) float32 in [-1, 1], each clipped there:

    0.  cruising speed / ``max_speed``: the highest of the agent's recording, which ``Idm`` has, too
    1.  way to the end of the route / ``range``
    2.  of each object, nearest first: 1; gap / ``range``; its speed along the route / ``max_speed``. Zeros for none

    Attributes:
        objects: Largest number of objects.
        margin: What the strip is wider than the agent, on each side [m]; negative for narrower.
        range: Largest gap [m].
        max_speed: [m/s].
    """

    low: ClassVar[float] = -1.0

    objects: Count = 2
    margin: float = 0.3
    range: Positive = 80.0
    max_speed: Positive = 30.0

    @property
    def shape(self) -> tuple[int, ...]:
        """(2 + 3 objects,)."""
        return (2 + LEADER * self.objects,)

    def observe(self, batch: WorldBatch, state: State, agents: Int32, rng: np.random.Generator, out: Array) -> Array:  # noqa: ARG002
        """Write what is on the route."""
        seen = np.empty((len(agents), *self.shape))
        memory = SightMemory.of(state.present.shape[1])
        lost = observe_leaders(agents, batch.recorded, state.moment, self.margin, self.range, memory, seen)
        require_located(lost, agents)
        full = [self.max_speed, self.range, *[1.0, self.range, self.max_speed] * self.objects]
        np.multiply(seen, 1.0 / np.array(full), out=out, casting="same_kind")
        return np.clip(out, -1.0, 1.0, out=out)


@dataclass(frozen=True)
class Guidance(Sensor):
    """What a driver would do at the agent's place: the acceleration of ``Idm``, and pure pursuit of the route.

    Observes (2,) float32 in [-1, 1]: steering and throttle. It is what ``dagger`` imitates, and no policy has it
    among its observations.

    Attributes:
        law: The driver model; by default it brakes for what is less than 0.3 m beside its way, too.
        ahead, least: The vehicle steers for the point of its route so many seconds and at least so many metres ahead.
        stopping, before: Deceleration with which it stops [m/s²], and how far before the end of its route [m].
        lag: Time in which another speed decays to that of the stop [s]: a learner's small errors ask for no hard
            braking, which a stop by the exact speed of the next step would.
        drive: Capabilities of the vehicle.
    """

    low: ClassVar[float] = -1.0

    law: Idm = field(default_factory=lambda: Idm(overlap=-0.3))
    ahead: float = 0.5
    least: float = 3.0
    stopping: float = 2.0
    before: float = 0.3
    lag: float = 0.5
    drive: Drive = field(default_factory=Drive)

    @property
    def shape(self) -> tuple[int, ...]:
        """(2,)."""
        return (2,)

    def observe(self, batch: WorldBatch, state: State, agents: Int32, rng: np.random.Generator, out: Array) -> Array:  # noqa: ARG002
        """Write steering and throttle."""
        drive = self.drive
        limits = self.ahead, self.least, drive.max_steer, drive.acceleration, drive.braking, drive.wheelbase
        numbers = np.array([*limits, self.stopping, self.before, self.lag])
        memory = SightMemory.of(state.present.shape[1])
        lost = guide(agents, batch.recorded, state.moment, LIGHT_COLORS, self.law.law, numbers, memory, out)
        require_located(lost, agents)
        return out
