"""Bullet backend: driven vehicles are rigid bodies with tyre forces and collisions.

Motion is planar, as in the recordings. Other objects become bodies of their own mass when they come within reach of a
driven vehicle; they reach the pose given by their policy at the end of the step regardless of collisions. pybullet is
imported when a session opens.
"""

from __future__ import annotations

import importlib
import math
import os
import sys
import weakref
from dataclasses import dataclass, field
from types import ModuleType
from typing import TYPE_CHECKING

from scenarionet_data.arrays.dtypes import Float64, Int32
from scenarionet_data.errors import BadParameter, MissingDependency
from scenarionet_data.scenario.settings import Count, check_settings
from scenarionet_sim.arrays.structures import OBJECTS
from scenarionet_sim.backends.base import SUBSTEPS, Drive
from scenarionet_sim.backends.body_kernels import find_bodies, read_motion, write_motion
from scenarionet_sim.backends.tyre_kernels import apply_tyres
from scenarionet_sim.backends.world_bodies import Key, WorldBodies

if TYPE_CHECKING:
    from scenarionet_sim.worlds.state import State
    from scenarionet_sim.worlds.world_batch import WorldBatch

_GRAVITY = 9.81  # [m/s²]
_NO_WHEEL = 3, 12
"""First version of Python that pybullet has no wheel for."""


@dataclass(frozen=True)
class Bullet:
    """Rigid-body physics by pybullet.

    Attributes:
        drive: Capabilities of the vehicles.
        tyre_friction: Largest tyre force as a share of the load.
        body_friction: Friction coefficient between bodies.
        restitution: Coefficient of restitution; 0 is a collision without rebound.
        substeps: Physics steps per control step.
        iterations: Contact solver iterations per physics step.
        max_asleep: Bodies out of reach that a world keeps.
    """

    drive: Drive = field(default_factory=Drive)
    tyre_friction: float = 0.9
    body_friction: float = 0.5
    restitution: float = 0.1
    substeps: Count = SUBSTEPS
    iterations: int = 10
    max_asleep: int = 32

    def __post_init__(self) -> None:
        check_settings(self)

    def open(self, batch: WorldBatch) -> BulletSession:
        """Open a session with its own physics client (about 30 MB, 20 ms).

        Raises:
            MissingDependency: pybullet is not installed.
        """
        return BulletSession(self, batch)


class BulletSession:
    """One pybullet client with the bodies of W worlds.

    Args:
        spec: Parameters of the backend.
        batch: The worlds.

    Raises:
        MissingDependency: pybullet is not installed.
        BadParameter: All 1,024 clients of pybullet are in use.
    """

    def __init__(self, spec: Bullet, batch: WorldBatch) -> None:
        bullet = _import_bullet()
        self._spec, self._batch = spec, batch
        self._bullet = bullet
        self._step = 0.0
        self._client: int = bullet.connect(bullet.DIRECT)
        if self._client < 0:
            raise BadParameter("all 1,024 pybullet clients of this process are in use; close environments")
        self._close = weakref.finalize(self, bullet.disconnect, self._client)
        bullet.setPhysicsEngineParameter(
            numSolverIterations=spec.iterations,
            solverResidualThreshold=0.0,  # otherwise convergence would depend on the contacts of all worlds
            deterministicOverlappingPairs=1,
            physicsClientId=self._client,
        )
        options = spec.body_friction, spec.restitution, spec.max_asleep
        self._worlds = [WorldBodies(bullet, self._client, level, *options) for level in range(len(batch))]

    def close(self) -> None:
        """Release the client; idempotent."""
        self._close()

    def reset(self, world: int, state: State) -> None:  # noqa: ARG002
        """Remove the bodies of a world; the next step creates those it needs.

        Raises:
            BadParameter: It has less friction, or more, than the tyres of this backend.
        """
        friction = self._batch.recorded.friction[self._batch.place[world, OBJECTS]]
        if friction != 1.0:
            raise BadParameter(f"a friction of {friction:g} is for the backend kinematic; bullet has that of its tyres")
        self._worlds[world].clear()

    def drive(self, state: State, agents: Int32, actions: Float64, dt: float) -> None:
        """Move the agents by one control step, see :class:`~scenarionet_sim.backends.base.Session`."""
        if not len(agents):
            return
        slack = self._spec.drive.acceleration * dt
        rows = find_bodies(state.motion, state.size, state.present, agents, slack, dt)
        motion = read_motion(state.motion, rows, len(agents), dt)
        bodies, driven = self._place(rows, len(agents), state.size, motion), motion[: len(agents)]
        size = state.size[agents[:, 0], agents[:, 1]]
        self._simulate(bodies[: len(agents)], driven, size, actions, dt / self._spec.substeps)
        write_motion(state.motion, agents, driven)

    # --- one step -------------------------------------------------------------------------------------

    def _place(self, rows: Int32, num_agents: int, size: Float64, motion: Float64) -> list[int]:
        """Return the bodies of objects, agents first, set to their poses; those of others to their velocities, too."""
        keys: list[list[Key]] = [[] for _ in self._worlds]
        for number, (world, row) in enumerate(rows.tolist()):
            keys[world].append((row, number < num_agents))
        gathered = [
            iter(bodies.gather(wanted, size[world]))
            for world, (bodies, wanted) in enumerate(zip(self._worlds, keys, strict=True))
        ]
        placed = []
        for number, (world, (x, y, heading, *velocity, turn)) in enumerate(
            zip(rows[:, 0].tolist(), motion.tolist(), strict=True)
        ):
            body = next(gathered[world])
            place, half = (x, y, self._worlds[world].height), 0.5 * heading
            self._bullet.resetBasePositionAndOrientation(
                body, place, (0.0, 0.0, math.sin(half), math.cos(half)), self._client
            )
            if number >= num_agents:
                self._bullet.resetBaseVelocity(body, (*velocity, 0.0), (0.0, 0.0, turn), self._client)
            placed.append(body)
        return placed

    def _simulate(self, bodies: list[int], motion: Float64, size: Float64, actions: Float64, step: float) -> None:
        """Run the physics steps with tyre forces; updates the agents' motion."""
        bullet, client, spec = self._bullet, self._client, self._spec
        car, friction = spec.drive, spec.tyre_friction * _GRAVITY
        vehicle = (car.max_steer, car.acceleration, car.braking, friction, car.max_speed, car.wheelbase)
        if step != self._step:
            bullet.setTimeStep(step, client)
            self._step = step
        for _ in range(spec.substeps):
            apply_tyres(motion, size, actions, vehicle, step)
            for body, (_, _, _, x, y, turn) in zip(bodies, motion.tolist(), strict=True):
                bullet.resetBaseVelocity(body, (x, y, 0.0), (0.0, 0.0, turn), client)
            bullet.stepSimulation(client)
            for row, body in zip(motion, bodies, strict=True):
                (x, y, _), (_, _, sin, cos) = bullet.getBasePositionAndOrientation(body, client)
                (along_x, along_y, _), (_, _, turn) = bullet.getBaseVelocity(body, client)
                row[:] = x, y, 2.0 * math.atan2(sin, cos), along_x, along_y, turn


def _import_bullet() -> ModuleType:
    """Import pybullet without the line it prints.

    Raises:
        MissingDependency: pybullet is not installed.
    """
    quiet, error_output = os.open(os.devnull, os.O_WRONLY), os.dup(2)
    try:
        os.dup2(quiet, 2)
        return importlib.import_module("pybullet")
    except ImportError as error:
        python, use_another = ".".join(map(str, sys.version_info[:2])), "use the backend Kinematic, the default"
        if sys.version_info >= _NO_WHEEL:
            need = f"the Bullet backend needs pybullet, which has no wheel for Python {python}, only for 3.11"
            raise MissingDependency(need, "", use_another) from error
        raise MissingDependency("the Bullet backend needs pybullet", "sim", f"or {use_another}") from error
    finally:
        os.dup2(error_output, 2)
        os.close(quiet)
        os.close(error_output)
