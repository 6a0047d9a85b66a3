"""The rigid bodies of one world in a Bullet client that many worlds share.

Worlds are stacked vertically at the same x and y, so that they are independent of each other and of their level.
Bodies rotate about the vertical axis only, and are tall, so that they collide at their sides.
"""

from __future__ import annotations

from types import ModuleType

from scenarionet_data.arrays.dtypes import Float64

Key = tuple[int, bool]
"""Row of an object, and whether it is driven."""

_LEVEL_HEIGHT = 128.0  # [m] from one world to the next
_HALF_HEIGHT = 16.0  # [m] of every body
_DENSITY = 120.0  # [kg/m³]: a car of 1,500 kg, a bus of 12 t, a pedestrian of 75 kg
_MIN_SIZE = 0.1  # [m]
_DRIVEN, _MOVED = 1, 2  # collision groups: objects moved by policies collide only with driven vehicles


class WorldBodies:
    """Bodies of one world: created on first use, asleep while unused.

    Args:
        bullet: The module pybullet.
        client: Number of the physics client.
        level: Vertical position in the stack.
        friction: Friction coefficient between bodies.
        restitution: Coefficient of restitution.
        max_asleep: Sleeping bodies to keep; creating one costs as much as ten physics steps.
    """

    def __init__(
        self, bullet: ModuleType, client: int, level: int, friction: float, restitution: float, max_asleep: int
    ) -> None:
        self.height = level * _LEVEL_HEIGHT
        self._bullet = bullet
        self._client = client
        self._friction = friction
        self._restitution = restitution
        self._max_asleep = max_asleep
        self._awake: dict[Key, int] = {}
        self._asleep: dict[Key, int] = {}

    def gather(self, keys: list[Key], size: Float64) -> list[int]:
        """Wake the bodies of some objects, put all others to sleep, and return their numbers.

        Args:
            keys: The objects, in the order of the result.
            size: (N, 3) of every object of the world [m].
        """
        awake = {key: self._wake(key, size[key[0]]) for key in keys}
        for key in [key for key in self._awake if key not in awake]:
            # Half a level up, where nothing collides with it.
            body, place = self._awake[key], (0.0, 0.0, self.height + 0.5 * _LEVEL_HEIGHT)
            self._bullet.resetBasePositionAndOrientation(body, place, (0.0, 0.0, 0.0, 1.0), self._client)
            self._activate(body, self._bullet.ACTIVATION_STATE_SLEEP)
            self._asleep[key] = body
        while len(self._asleep) > self._max_asleep:
            self._bullet.removeBody(self._asleep.pop(next(iter(self._asleep))), self._client)
        self._awake = awake
        return list(awake.values())

    def clear(self) -> None:
        """Remove every body."""
        for body in (*self._awake.values(), *self._asleep.values()):
            self._bullet.removeBody(body, self._client)
        self._awake, self._asleep = {}, {}

    def _wake(self, key: Key, size: Float64) -> int:
        if key in self._awake:
            return self._awake[key]
        if key not in self._asleep:
            return self._make(key, size)
        body = self._asleep.pop(key)
        self._activate(body, self._bullet.ACTIVATION_STATE_DISABLE_SLEEPING)
        return body

    def _activate(self, body: int, state: int) -> None:
        self._bullet.changeDynamics(body, -1, activationState=state, physicsClientId=self._client)

    def _make(self, key: Key, size: Float64) -> int:
        length, width, height = (max(float(metres), _MIN_SIZE) for metres in size)
        mass = _DENSITY * length * width * height
        extents = (0.5 * length, 0.5 * width, _HALF_HEIGHT)
        shape = self._bullet.createCollisionShape(
            self._bullet.GEOM_BOX, halfExtents=extents, physicsClientId=self._client
        )
        body: int = self._bullet.createMultiBody(mass, shape, useMaximalCoordinates=1, physicsClientId=self._client)
        self._bullet.changeDynamics(
            body,
            -1,
            mass=mass,
            localInertiaDiagonal=(0.0, 0.0, mass * (length**2 + width**2) / 12.0),  # 0: no rotation about that axis
            linearDamping=0.0,
            angularDamping=0.0,
            lateralFriction=self._friction,
            restitution=self._restitution,
            activationState=self._bullet.ACTIVATION_STATE_DISABLE_SLEEPING,
            physicsClientId=self._client,
        )
        group, mask = (_DRIVEN, _DRIVEN | _MOVED) if key[1] else (_MOVED, _DRIVEN)
        self._bullet.setCollisionFilterGroupMask(body, -1, group, mask, self._client)
        return body
