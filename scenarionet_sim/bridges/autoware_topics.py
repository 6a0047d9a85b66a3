"""Topics and services of Autoware's planning simulator, and the messages of a moment on them.

``base_link`` is on the ground under the middle of the rear axle, x forward, y left, z up.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from scenarionet_data.interchange.numbering import light_number
from scenarionet_data.interchange.ros.messages import RosMessages
from scenarionet_data.scenario.vocabulary import LightColor, LightState, ObjectType
from scenarionet_sim.backends.base import Drive
from scenarionet_sim.bridges.link import StackMoment
from scenarionet_sim.bridges.ros_topics import Topic, point_cloud
from scenarionet_sim.planners.view import View

TOPICS = {
    "tf": Topic("tf2_msgs/msg/TFMessage", "`map` to `base_link`"),
    "localization/kinematic_state": Topic("nav_msgs/msg/Odometry", "pose in `map`, speed and yaw rate in `base_link`"),
    "localization/acceleration": Topic("geometry_msgs/msg/AccelWithCovarianceStamped", "along the heading"),
    "vehicle/status/velocity_status": Topic("autoware_vehicle_msgs/msg/VelocityReport", "speed and yaw rate"),
    "vehicle/status/steering_status": Topic(
        "autoware_vehicle_msgs/msg/SteeringReport", "angle of the front wheels, by the motion"
    ),
    "vehicle/status/control_mode": Topic(
        "autoware_vehicle_msgs/msg/ControlModeReport", "AUTONOMOUS, or MANUAL as the stack asked for"
    ),
    "vehicle/status/gear_status": Topic("autoware_vehicle_msgs/msg/GearReport", "as asked for; first PARK"),
    "vehicle/status/turn_indicators_status": Topic("autoware_vehicle_msgs/msg/TurnIndicatorsReport", "as asked for"),
    "vehicle/status/hazard_lights_status": Topic("autoware_vehicle_msgs/msg/HazardLightsReport", "as asked for"),
    "perception/object_recognition/objects": Topic(
        "autoware_perception_msgs/msg/PredictedObjects",
        "boxes and velocities of the other objects, each with a path of 10 s at its velocity",
    ),
    "perception/traffic_light_recognition/traffic_signals": Topic(
        "autoware_perception_msgs/msg/TrafficLightGroupArray", "colours by group, the id of the light's rule in the map"
    ),
    "perception/obstacle_segmentation/pointcloud": Topic("sensor_msgs/msg/PointCloud2", "empty"),
    "perception/occupancy_grid_map/map": Topic("nav_msgs/msg/OccupancyGrid", "free: 200 m around the vehicle"),
    "clock": Topic("rosgraph_msgs/msg/Clock", "the moment"),
}
"""What Autoware gets at each moment, in this order."""

ANSWERS = {
    "control/command/control_cmd": Topic(
        "autoware_control_msgs/msg/Control", "angle of the front wheels and acceleration (or speed), with the stamp"
    ),
    "control/command/gear_cmd": Topic(
        "autoware_vehicle_msgs/msg/GearCommand", "in PARK the vehicle brakes, in NEUTRAL and NONE it rolls"
    ),
    "control/command/turn_indicators_cmd": Topic("autoware_vehicle_msgs/msg/TurnIndicatorsCommand", "reported back"),
    "control/command/hazard_lights_cmd": Topic("autoware_vehicle_msgs/msg/HazardLightsCommand", "reported back"),
    "vehicle/engage": Topic("autoware_vehicle_msgs/msg/Engage", "control mode AUTONOMOUS, or MANUAL"),
    "api/routing/state": Topic("autoware_adapi_v1_msgs/msg/RouteState", "whether there is a route"),
    "api/operation_mode/state": Topic("autoware_adapi_v1_msgs/msg/OperationModeState", "whether Autoware drives"),
}
"""What Autoware sends."""

SERVED = {"control/control_mode_request": "autoware_vehicle_msgs/srv/ControlModeCommand"}
"""Services that the vehicle has."""

CALLED = {
    "api/operation_mode/change_to_stop": "autoware_adapi_v1_msgs/srv/ChangeOperationMode",
    "api/routing/clear_route": "autoware_adapi_v1_msgs/srv/ClearRoute",
    "api/routing/set_route_points": "autoware_adapi_v1_msgs/srv/SetRoutePoints",
    "api/operation_mode/change_to_autonomous": "autoware_adapi_v1_msgs/srv/ChangeOperationMode",
}
"""Services of Autoware that are called where a scenario begins, in this order."""

AUTONOMOUS, MANUAL = 1, 4
"""Control modes."""

_LABELS = {
    ObjectType.VEHICLE: 1,
    ObjectType.CYCLIST: 6,
    ObjectType.PEDESTRIAN: 7,
    **dict.fromkeys((ObjectType.TRAFFIC_CONE, ObjectType.TRAFFIC_BARRIER, ObjectType.TRAFFIC_OBJECT), 9),
}
_TRUCK, _TRUCK_LENGTH = 2, 7.0  # [m]
_COLORS = {LightColor.RED: 1, LightColor.YELLOW: 2, LightColor.GREEN: 3}
_ARROWS = (LightState.LANE_STATE_ARROW_STOP, LightState.LANE_STATE_ARROW_CAUTION, LightState.LANE_STATE_ARROW_GO)
_FLASHING = (LightState.LANE_STATE_FLASHING_STOP, LightState.LANE_STATE_FLASHING_CAUTION)
_CIRCLE, _UP_ARROW = 1, 4
_ON, _FLASHES = 2, 3
_STEP, _STEPS = 500_000_000, 20  # [ns] of predicted paths
_CELL, _CELLS = 1.0, 200  # [m] of the occupancy grid


@dataclass
class VehicleReports:
    """What Autoware asked of the vehicle beside motion, and the vehicle reports.

    Attributes:
        gear, indicators, hazard: Codes of the reports.
        mode: AUTONOMOUS or MANUAL.
        steering: Angle of the front wheels, the last one that motion showed [rad].
    """

    gear: int = 22
    indicators: int = 1
    hazard: int = 1
    mode: int = AUTONOMOUS
    steering: float = 0.0


class RearAxle(NamedTuple):
    """Where ``base_link`` is, and how it moves.

    Attributes:
        x, y, heading: In ``map`` [m], [rad].
        speed: Along the heading [m/s].
        angle: Of the front wheels for the yaw rate at the speed [rad]; None at a standstill.
    """

    x: float
    y: float
    heading: float
    speed: float
    angle: float | None

    @classmethod
    def of(cls, view: View) -> RearAxle:
        """Return that of the vehicle of a view, a bicycle with its axles as in :class:`Drive`."""
        ego = view.ego
        base = Drive().wheelbase * ego.length
        across = ego.yaw_rate * base / 2.0  # of the centre; the rear axle has none
        speed = math.copysign(math.sqrt(max(ego.speed**2 - across**2, 0.0)), ego.speed)
        angle = math.atan(base * ego.yaw_rate / speed) if abs(speed) > 0.1 else None
        return cls(*behind(ego.x, ego.y, ego.heading, base / 2.0), ego.heading, speed, angle)


def behind(x: float, y: float, heading: float, distance: float) -> tuple[float, float]:
    """Return the point that is a distance [m] behind a pose."""
    return x - distance * math.cos(heading), y - distance * math.sin(heading)


def moment_messages(ros: RosMessages, moment: StackMoment, vehicle: VehicleReports) -> Iterator[tuple[str, Any]]:
    """Yield topic and message of a moment, in the order of TOPICS."""
    view, header = moment.view, ros.header(moment.stamp, "map")
    own, now = ros.header(moment.stamp, "base_link"), header.stamp
    rear = RearAxle.of(view)
    vehicle.steering = vehicle.steering if rear.angle is None else rear.angle
    speed, yaw_rate, acceleration = rear.speed, view.ego.yaw_rate, view.ego.acceleration
    if not moment.is_ready:
        speed = yaw_rate = acceleration = 0.0
    pose = ros.pose(rear.x, rear.y, rear.heading)
    place = pose.position
    frame = ros.transform(header, "base_link", (place.x, place.y, 0.0), pose.orientation)
    kind = "autoware_vehicle_msgs"
    contents = (
        ros.make("tf2_msgs/TFMessage", transforms=[frame]),
        ros.odometry(header, pose, speed, yaw_rate),
        ros.make("geometry_msgs/AccelWithCovarianceStamped", header=own, accel=_accel(ros, acceleration)),
        ros.make(
            f"{kind}/VelocityReport", header=own, longitudinal_velocity=speed, lateral_velocity=0.0,
            heading_rate=yaw_rate,
        ),
        ros.make(f"{kind}/SteeringReport", stamp=now, steering_tire_angle=vehicle.steering),
        ros.make(f"{kind}/ControlModeReport", stamp=now, mode=vehicle.mode),
        ros.make(f"{kind}/GearReport", stamp=now, report=vehicle.gear),
        ros.make(f"{kind}/TurnIndicatorsReport", stamp=now, report=vehicle.indicators),
        ros.make(f"{kind}/HazardLightsReport", stamp=now, report=vehicle.hazard),
        ros.make("autoware_perception_msgs/PredictedObjects", header=header, objects=list(_objects(ros, moment))),
        ros.make("autoware_perception_msgs/TrafficLightGroupArray", stamp=now, traffic_light_groups=_lights(ros, view)),
        point_cloud(ros, own, np.zeros((0, 4), np.float32)),
        _free_space(ros, header, rear),
        ros.make("rosgraph_msgs/Clock", clock=now),
    )  # fmt: skip
    yield from zip(TOPICS, contents, strict=True)


def _sure(ros: RosMessages, name: str, **fields: Any) -> Any:
    """A value with a covariance of 0."""
    return ros.make(f"geometry_msgs/{name}WithCovariance", covariance=np.zeros(36), **fields)


def _accel(ros: RosMessages, along: float) -> Any:
    none = ros.vector(0.0, 0.0, 0.0)
    told = ros.make("geometry_msgs/Accel", linear=ros.vector(along, 0.0, 0.0), angular=none)
    return _sure(ros, "Accel", accel=told)


def _objects(ros: RosMessages, moment: StackMoment) -> Iterator[Any]:
    found, nothing = moment.view.objects, ros.vector(0.0, 0.0, 0.0)
    for row, track in enumerate(found.track_ids):
        (x, y), (vx, vy) = found.position[row].tolist(), found.velocity[row].tolist()
        heading, size = float(found.heading[row]), found.size[row].tolist()
        if not moment.is_ready:
            vx = vy = 0.0
        cos, sin = math.cos(heading), math.sin(heading)
        linear = ros.vector(cos * vx + sin * vy, cos * vy - sin * vx, 0.0)
        times = [step * _STEP / 1e9 for step in range(_STEPS + 1)]
        path = ros.make(
            "autoware_perception_msgs/PredictedPath",
            path=[ros.pose(x + time * vx, y + time * vy, heading, size[2] / 2.0) for time in times],
            time_step=ros.make("builtin_interfaces/Duration", sec=0, nanosec=_STEP),
            confidence=1.0,
        )
        twist = ros.make("geometry_msgs/Twist", linear=linear, angular=nothing)
        label = _LABELS.get(ObjectType(found.object_type[row]), 0)
        label = _TRUCK if label == 1 and size[0] > _TRUCK_LENGTH else label
        yield ros.make(
            "autoware_perception_msgs/PredictedObject",
            object_id=ros.make(
                "unique_identifier_msgs/UUID",
                uuid=np.frombuffer(hashlib.blake2b(str(track).encode(), digest_size=16).digest(), np.uint8),
            ),
            existence_probability=1.0,
            classification=[ros.make("autoware_perception_msgs/ObjectClassification", label=label, probability=1.0)],
            kinematics=ros.make(
                "autoware_perception_msgs/PredictedObjectKinematics",
                initial_pose_with_covariance=_sure(ros, "Pose", pose=ros.pose(x, y, heading, size[2] / 2.0)),
                initial_twist_with_covariance=_sure(ros, "Twist", twist=twist),
                initial_acceleration_with_covariance=_accel(ros, 0.0),
                predicted_paths=[path],
            ),
            shape=ros.make(
                "autoware_perception_msgs/Shape", type=0, footprint=ros.make("geometry_msgs/Polygon", points=[]),
                dimensions=ros.vector(*size),
            ),
        )  # fmt: skip


def _lights(ros: RosMessages, view: View) -> list[Any]:
    lights, lane_ids, groups = view.lights, view.world.roads.lane_ids, []
    for lane, state, color in zip(lights.lane.tolist(), lights.state.tolist(), lights.color.tolist(), strict=True):
        if state == LightState.ABSENT or lane < 0:
            continue
        element = ros.make(
            "autoware_perception_msgs/TrafficLightElement", color=_COLORS.get(LightColor(color), 0),
            shape=_UP_ARROW if state in _ARROWS else _CIRCLE, status=_FLASHES if state in _FLASHING else _ON,
            confidence=1.0,
        )  # fmt: skip
        number = light_number(str(lane_ids[lane]))
        groups.append(
            ros.make(
                "autoware_perception_msgs/TrafficLightGroup", traffic_light_group_id=number, elements=[element],
                predictions=[],
            )
        )  # fmt: skip
    return groups


def _free_space(ros: RosMessages, header: Any, rear: RearAxle) -> Any:
    corner = ros.pose(rear.x - _CELLS * _CELL / 2.0, rear.y - _CELLS * _CELL / 2.0, 0.0)
    told = ros.make(
        "nav_msgs/MapMetaData", map_load_time=header.stamp, resolution=_CELL, width=_CELLS, height=_CELLS, origin=corner
    )
    return ros.make("nav_msgs/OccupancyGrid", header=header, info=told, data=_FREE)


_FREE = np.zeros(_CELLS * _CELLS, np.int8)
