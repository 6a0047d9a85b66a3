"""What the sensors of an agent measure: CARLA's units and axes, x ahead, y to the right, z up.

Values are those of the scene, without noise. Source: the reference of sensors of CARLA 0.9.16, and the attributes that
the leaderboard's ``agent_wrapper.py`` gives them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Float32, Float64
from scenarionet_data.errors import BadParameter
from scenarionet_sim.bridges.sensing import StackSensors
from scenarionet_sim.planners.view import View
from scenarionet_sim.sensors.base import Sensor
from scenarionet_sim.sensors.camera import Camera, Mount
from scenarionet_sim.sensors.scene_lidar import SceneLidar

REFERENCE = (42.0, 2.0)
"""Latitude and longitude [degrees] of the scenario frame's origin: CARLA's, for maps that say nothing."""

_EARTH = 6_378_137.0  # [m]
_GRAVITY = 9.81  # [m/s²]
_LIDAR = SceneLidar(tuple(np.radians(np.linspace(10.0, -30.0, 64)).tolist()), azimuths=937, range=85.0)
_RADAR = 100.0, 12  # [m], rays of a side


class AgentSensors:
    """The sensors that an agent asks for.

    Args:
        specs: As the agent's ``sensors()`` returns them.
        opendrive: Returns the map as OpenDRIVE.

    Raises:
        BadParameter: There is no such sensor, or it lacks a setting.
    """

    def __init__(self, specs: Sequence[Mapping[str, Any]], opendrive: Callable[[], str]) -> None:
        self._specs, self._opendrive = {str(spec.get("id")): spec for spec in specs}, opendrive
        drawn: dict[str, Sensor] = {}
        for name, spec in self._specs.items():
            if spec.get("type") not in _READERS:
                raise BadParameter(
                    f"the agent asks for sensor {name!r} of type {spec.get('type')!r}; there are {', '.join(_READERS)}"
                )
            try:
                made = _drawn(spec)
            except KeyError as error:
                raise BadParameter(f"the agent's sensor {name!r} lacks {error}; found {dict(spec)}") from error
            if made is not None:
                drawn[name] = made
        self._sensors, self._drawn = StackSensors(drawn), drawn

    def read(self, view: View) -> Iterator[tuple[str, Any]]:
        """Yield id and measurement of each sensor, as the leaderboard hands them over."""
        seen = self._sensors.look(view)
        for name, spec in self._specs.items():
            if spec["type"] == "sensor.opendrive_map":
                yield name, {"opendrive": self._opendrive()}
            else:
                yield name, _READERS[spec["type"]](view, spec, self._drawn.get(name), seen.get(name))


def _drawn(spec: Mapping[str, Any]) -> Sensor | None:
    """The sensor of the simulator that a sensor is drawn by; None if it needs none."""
    kind = spec["type"]
    if kind not in ("sensor.camera.rgb", "sensor.lidar.ray_cast", "sensor.other.radar"):
        return None
    turns = [math.radians(spec[name]) for name in ("yaw", "pitch", "roll")]
    mount = Mount(spec["x"], -spec["y"], spec["z"], -turns[0], turns[1], turns[2])
    if kind == "sensor.lidar.ray_cast":
        return replace(_LIDAR, mount=mount)
    if kind == "sensor.camera.rgb":
        return Camera(int(spec["width"]), int(spec["height"]), math.radians(spec["fov"]), mount=mount)
    reach, rays = _RADAR
    wide, high = (math.tan(math.radians(spec[name]) / 2.0) for name in ("horizontal_fov", "vertical_fov"))
    focal = rays / 2.0 / wide
    height = max(1, round(rays * high / wide))
    return Camera(
        rays, height, intrinsics=(focal, focal, rays / 2.0, height / 2.0), mount=mount,
        channels=("depth", "instance"), range=reach,
    )  # fmt: skip


def picture(view: View, spec: Mapping[str, Any], sensor: Any, seen: Any) -> Array:
    """Return a camera's (height, width, 4) uint8 blue, green, red, 255."""
    del view, spec, sensor
    return np.dstack([seen[..., ::-1], np.full(seen.shape[:2], 255, np.uint8)])


def points(view: View, spec: Mapping[str, Any], sensor: Any, seen: Any) -> Float32:
    """Return a lidar's (n, 4) float32 x, y, z [m] and intensity."""
    del view, spec
    found: Float32 = sensor.points(seen) * np.array([1.0, -1.0, 1.0, 1.0], np.float32)
    return found


def echoes(view: View, spec: Mapping[str, Any], sensor: Any, seen: Any) -> Float32:
    """Return a radar's (n, 4) float32 distance [m], altitude and azimuth [rad], speed away from the radar [m/s]."""
    del spec
    fx, _, cx, cy = sensor.matrix
    depth, instance = seen[..., 0], seen[..., 1].astype(np.int64)
    row, column = np.nonzero(depth < sensor.range)
    ahead = depth[row, column].astype(np.float64)
    right, up = (column + 0.5 - cx) / fx * ahead, (cy - row - 0.5) / fx * ahead
    distance = np.sqrt(ahead**2 + right**2 + up**2)
    azimuth = np.arctan2(right, ahead)
    ego = view.ego
    bearing = ego.heading + sensor.mount.yaw - azimuth
    velocity = np.zeros((len(view.state.present[view.slot]) + 1, 2))  # the last stands for what is no object
    velocity[view.objects.rows] = view.objects.velocity
    relative = velocity[instance[row, column]] - ego.speed * np.array([math.cos(ego.heading), math.sin(ego.heading)])
    away = (relative[:, 0] * np.cos(bearing) + relative[:, 1] * np.sin(bearing)) * np.hypot(ahead, right) / distance
    return np.column_stack([distance, np.arcsin(up / distance), azimuth, away]).astype(np.float32)


def position(view: View, spec: Mapping[str, Any], sensor: Any, seen: Any) -> Float64:
    """Return a receiver's (3,) latitude and longitude [degrees], altitude [m]."""
    del sensor, seen
    ego, (ahead, right) = view.ego, (spec.get("x", 0.0), spec.get("y", 0.0))
    cos, sin = math.cos(ego.heading), math.sin(ego.heading)
    return np.array(
        [*degrees_of(ego.x + cos * ahead + sin * right, ego.y + sin * ahead - cos * right), spec.get("z", 0.0)]
    )


def motion(view: View, spec: Mapping[str, Any], sensor: Any, seen: Any) -> Float64:
    """Return (7,) acceleration with gravity [m/s²], rates [rad/s] about x, y, z, and the bearing from north [rad]."""
    del sensor, seen
    ego, turn = view.ego, math.radians(spec.get("yaw", 0.0))
    ahead, right = ego.acceleration, -ego.speed * ego.yaw_rate
    cos, sin = math.cos(turn), math.sin(turn)
    bearing = (math.pi / 2.0 - ego.heading + turn) % (2.0 * math.pi)
    return np.array([cos * ahead + sin * right, cos * right - sin * ahead, _GRAVITY, 0.0, 0.0, -ego.yaw_rate, bearing])


_READERS: dict[str, Callable[[View, Mapping[str, Any], Any, Any], Any]] = {
    "sensor.camera.rgb": picture,
    "sensor.lidar.ray_cast": points,
    "sensor.other.radar": echoes,
    "sensor.other.gnss": position,
    "sensor.other.imu": motion,
    "sensor.speedometer": lambda view, *_: {"speed": view.ego.speed},
    "sensor.opendrive_map": lambda *_: None,
}


def degrees_of(x: float, y: float) -> tuple[float, float]:
    """Return latitude and longitude [degrees] of a point of the scenario's frame [m]: Mercator's, as CARLA's."""
    latitude, longitude = REFERENCE
    scale = math.cos(math.radians(latitude))
    east = scale * math.radians(longitude) * _EARTH + x
    north = scale * _EARTH * math.log(math.tan(math.radians(90.0 + latitude) / 2.0)) + y
    return (
        math.degrees(2.0 * math.atan(math.exp(north / (_EARTH * scale))) - math.pi / 2.0),
        math.degrees(east / (_EARTH * scale)),
    )
