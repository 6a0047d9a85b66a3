"""Pictures in space: what the ego's camera or driver sees, or the ego from behind or from a circle around it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from scenarionet_data.arrays.dtypes import Float32, Int32, UInt8
from scenarionet_data.errors import BadParameter
from scenarionet_data.plots import Moment
from scenarionet_sim.arrays.log import HEADING, VALID
from scenarionet_sim.cameras.weather import DAY, Weather
from scenarionet_sim.sensors.camera import Camera, Mount
from scenarionet_sim.sensors.camera_presets import CHASE, COCKPIT
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world import World
from scenarionet_sim.worlds.world_batch import WorldBatch

SPACE_VIEWS = ("camera", "chase", "cockpit", "orbit")

_ORBIT_TIME = 12.0
"""Time of one round of the view ``orbit`` [s]."""

_ORBIT_RADIUS, _ORBIT_HEIGHT = 15.0, 6.5


@dataclass(frozen=True)
class Film:
    """A view of the ego or another object in space.

    Attributes:
        view: ``camera`` behind the windscreen, ``cockpit`` at the driver's eyes, ``chase`` behind the vehicle or
            ``orbit`` around it.
        width, height: [pixels].
        weather: Light and weather.
        seed: Seed of the surroundings.
        supersampling: Rays per pixel and axis.

    Raises:
        BadParameter: The view is unknown.
    """

    view: str = "chase"
    width: int = 1280
    height: int = 720
    weather: Weather = DAY
    seed: int = 0
    supersampling: int = 2

    def __post_init__(self) -> None:
        if self.view not in SPACE_VIEWS:
            raise BadParameter(f"view={self.view!r}; choose from {', '.join(SPACE_VIEWS)}")

    def camera(self, seconds: float, size: Float32) -> Camera:
        """Return the camera at a time, on an object of a size (3,) [m]."""
        behind = replace(CHASE, x=min(CHASE.x, -size[0] / 2 - 2.5 * size[2]), z=max(CHASE.z, size[2] + 1.8))
        mount = {"camera": Mount(), "chase": behind, "cockpit": COCKPIT}.get(self.view)
        if mount is None:
            turn = 2.0 * np.pi * seconds / _ORBIT_TIME
            x, y = -_ORBIT_RADIUS * np.cos(turn), -_ORBIT_RADIUS * np.sin(turn)
            mount = Mount(float(x), float(y), _ORBIT_HEIGHT, turn, -np.arctan2(_ORBIT_HEIGHT - 1.0, _ORBIT_RADIUS))
        own = {"camera": "hidden", "cockpit": "inside"}.get(self.view, "outside")
        return Camera(
            self.width, self.height, fov=1.25, mount=mount, weather=self.weather, seed=self.seed,
            supersampling=self.supersampling, own=own, vignette=0.12,
        )  # fmt: skip

    def frames(self, world: World, moments: Sequence[Moment], row: int | None = None) -> Iterator[UInt8]:
        """Yield the pictures (height, width, 3) of moments one timestep apart.

        Args:
            world: The scenario.
            moments: Its object states in order, see :func:`recorded_moments` and ``rollout_moments``.
            row: The object that carries the camera; None for the ego.
        """
        batch, row = WorldBatch([world]), world.ego if row is None else row
        agents: Int32 = np.array([[0, row]], np.int32)
        # From outside the ego alone has the ego's colour; from inside, the vehicle of the camera is drawn as such.
        own: Int32 = np.array([world.ego if self.view in ("chase", "orbit") else row], np.int32)
        for number, moment in enumerate(moments):
            after = moments[min(number + 1, len(moments) - 1)]
            state = _state(world, moment, after)
            yield self.camera(number * world.dt, world.size[row]).frames(batch, state, agents, own=own)["rgb"][0]


def recorded_moments(world: World) -> list[Moment]:
    """Return the recorded moments of a world at which its ego is present."""
    log = world.log
    (steps,) = np.nonzero(log[:, world.ego, VALID] != 0)
    return [
        Moment(int(t), log[t, :, :2].astype(np.float64), log[t, :, HEADING].astype(np.float64), world.log_valid[t])
        for t in steps
    ]


def _state(world: World, moment: Moment, after: Moment) -> State:
    """Return the state of a moment; velocities are those to the next one."""
    state = State.empty(1, world.num_objects)
    state.size[0], state.object_type[0] = world.size, world.object_type
    state.position[0], state.heading[0] = moment.position, moment.heading
    state.present[0] = moment.present & np.isfinite(moment.position).all(axis=1)
    span = max(after.timestep - moment.timestep, 1) * world.dt
    moves = moment.present & after.present
    state.velocity[0] = np.where(moves[:, None], (after.position - moment.position) / span, 0.0)
    turn = (after.heading - moment.heading + np.pi) % (2.0 * np.pi) - np.pi
    state.yaw_rate[0] = np.where(moves, turn / span, 0.0)
    state.timestep[0] = moment.timestep
    return state
