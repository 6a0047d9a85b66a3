"""Messages and services of Autoware for stacks with cyclonedds alone, in its own terms."""

from dataclasses import dataclass

from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import array, float32, float64, int32, int64, sequence, uint8, uint16, uint32, uint64
from idl_messages import Header, Pose, PoseWithCovariance, Time, TwistWithCovariance, Vector3


@dataclass
class Point32(IdlStruct, typename="geometry_msgs::msg::dds_::Point32_"):
    x: float32
    y: float32
    z: float32


@dataclass
class Polygon(IdlStruct, typename="geometry_msgs::msg::dds_::Polygon_"):
    points: sequence[Point32]


@dataclass
class Accel(IdlStruct, typename="geometry_msgs::msg::dds_::Accel_"):
    linear: Vector3
    angular: Vector3


@dataclass
class AccelWithCovariance(IdlStruct, typename="geometry_msgs::msg::dds_::AccelWithCovariance_"):
    accel: Accel
    covariance: array[float64, 36]


@dataclass
class AccelWithCovarianceStamped(IdlStruct, typename="geometry_msgs::msg::dds_::AccelWithCovarianceStamped_"):
    header: Header
    accel: AccelWithCovariance


@dataclass
class Uuid(IdlStruct, typename="unique_identifier_msgs::msg::dds_::UUID_"):
    uuid: array[uint8, 16]


@dataclass
class Duration(IdlStruct, typename="builtin_interfaces::msg::dds_::Duration_"):
    sec: int32
    nanosec: uint32


@dataclass
class ObjectClassification(IdlStruct, typename="autoware_perception_msgs::msg::dds_::ObjectClassification_"):
    label: uint8
    probability: float32


@dataclass
class PredictedPath(IdlStruct, typename="autoware_perception_msgs::msg::dds_::PredictedPath_"):
    path: sequence[Pose]
    time_step: Duration
    confidence: float32


@dataclass
class PredictedObjectKinematics(IdlStruct, typename="autoware_perception_msgs::msg::dds_::PredictedObjectKinematics_"):
    initial_pose_with_covariance: PoseWithCovariance
    initial_twist_with_covariance: TwistWithCovariance
    initial_acceleration_with_covariance: AccelWithCovariance
    predicted_paths: sequence[PredictedPath]


@dataclass
class Shape(IdlStruct, typename="autoware_perception_msgs::msg::dds_::Shape_"):
    type: uint8
    footprint: Polygon
    dimensions: Vector3


@dataclass
class PredictedObject(IdlStruct, typename="autoware_perception_msgs::msg::dds_::PredictedObject_"):
    object_id: Uuid
    existence_probability: float32
    classification: sequence[ObjectClassification]
    kinematics: PredictedObjectKinematics
    shape: Shape


@dataclass
class PredictedObjects(IdlStruct, typename="autoware_perception_msgs::msg::dds_::PredictedObjects_"):
    header: Header
    objects: sequence[PredictedObject]


@dataclass
class TrafficLightElement(IdlStruct, typename="autoware_perception_msgs::msg::dds_::TrafficLightElement_"):
    color: uint8
    shape: uint8
    status: uint8
    confidence: float32


@dataclass
class PredictedTrafficLightState(
    IdlStruct, typename="autoware_perception_msgs::msg::dds_::PredictedTrafficLightState_"
):
    predicted_stamp: Time
    simultaneous_elements: sequence[TrafficLightElement]
    reliability: float32
    information_source: str


@dataclass
class TrafficLightGroup(IdlStruct, typename="autoware_perception_msgs::msg::dds_::TrafficLightGroup_"):
    traffic_light_group_id: int64
    elements: sequence[TrafficLightElement]
    predictions: sequence[PredictedTrafficLightState]


@dataclass
class TrafficLightGroupArray(IdlStruct, typename="autoware_perception_msgs::msg::dds_::TrafficLightGroupArray_"):
    stamp: Time
    traffic_light_groups: sequence[TrafficLightGroup]


@dataclass
class GearReport(IdlStruct, typename="autoware_vehicle_msgs::msg::dds_::GearReport_"):
    stamp: Time
    report: uint8


@dataclass
class GearCommand(IdlStruct, typename="autoware_vehicle_msgs::msg::dds_::GearCommand_"):
    stamp: Time
    command: uint8


@dataclass
class VelocityReport(IdlStruct, typename="autoware_vehicle_msgs::msg::dds_::VelocityReport_"):
    header: Header
    longitudinal_velocity: float32
    lateral_velocity: float32
    heading_rate: float32


@dataclass
class SteeringReport(IdlStruct, typename="autoware_vehicle_msgs::msg::dds_::SteeringReport_"):
    stamp: Time
    steering_tire_angle: float32


@dataclass
class ControlModeReport(IdlStruct, typename="autoware_vehicle_msgs::msg::dds_::ControlModeReport_"):
    stamp: Time
    mode: uint8


@dataclass
class Engage(IdlStruct, typename="autoware_vehicle_msgs::msg::dds_::Engage_"):
    stamp: Time
    engage: bool


@dataclass
class Lateral(IdlStruct, typename="autoware_control_msgs::msg::dds_::Lateral_"):
    stamp: Time
    control_time: Time
    steering_tire_angle: float32
    steering_tire_rotation_rate: float32
    is_defined_steering_tire_rotation_rate: bool


@dataclass
class Longitudinal(IdlStruct, typename="autoware_control_msgs::msg::dds_::Longitudinal_"):
    stamp: Time
    control_time: Time
    velocity: float32
    acceleration: float32
    jerk: float32
    is_defined_acceleration: bool
    is_defined_jerk: bool


@dataclass
class Control(IdlStruct, typename="autoware_control_msgs::msg::dds_::Control_"):
    stamp: Time
    control_time: Time
    lateral: Lateral
    longitudinal: Longitudinal


@dataclass
class RouteState(IdlStruct, typename="autoware_adapi_v1_msgs::msg::dds_::RouteState_"):
    stamp: Time
    state: uint16


@dataclass
class OperationModeState(IdlStruct, typename="autoware_adapi_v1_msgs::msg::dds_::OperationModeState_"):
    stamp: Time
    mode: uint8
    is_autoware_control_enabled: bool
    is_in_transition: bool
    is_stop_mode_available: bool
    is_autonomous_mode_available: bool
    is_local_mode_available: bool
    is_remote_mode_available: bool


@dataclass
class ResponseStatus(IdlStruct, typename="autoware_adapi_v1_msgs::msg::dds_::ResponseStatus_"):
    success: bool
    code: uint16
    message: str


@dataclass
class RouteOption(IdlStruct, typename="autoware_adapi_v1_msgs::msg::dds_::RouteOption_"):
    allow_goal_modification: bool


@dataclass
class ClearRouteRequest(IdlStruct, typename="autoware_adapi_v1_msgs::srv::dds_::ClearRoute_Request_"):
    client: uint64
    number: int64
    structure_needs_at_least_one_member: uint8


@dataclass
class ClearRouteResponse(IdlStruct, typename="autoware_adapi_v1_msgs::srv::dds_::ClearRoute_Response_"):
    client: uint64
    number: int64
    status: ResponseStatus


@dataclass
class SetRoutePointsRequest(IdlStruct, typename="autoware_adapi_v1_msgs::srv::dds_::SetRoutePoints_Request_"):
    client: uint64
    number: int64
    header: Header
    option: RouteOption
    goal: Pose
    waypoints: sequence[Pose]


@dataclass
class SetRoutePointsResponse(IdlStruct, typename="autoware_adapi_v1_msgs::srv::dds_::SetRoutePoints_Response_"):
    client: uint64
    number: int64
    status: ResponseStatus


@dataclass
class ChangeOperationModeRequest(IdlStruct, typename="autoware_adapi_v1_msgs::srv::dds_::ChangeOperationMode_Request_"):
    client: uint64
    number: int64
    structure_needs_at_least_one_member: uint8


@dataclass
class ChangeOperationModeResponse(
    IdlStruct, typename="autoware_adapi_v1_msgs::srv::dds_::ChangeOperationMode_Response_"
):
    client: uint64
    number: int64
    status: ResponseStatus


@dataclass
class ControlModeRequest(IdlStruct, typename="autoware_vehicle_msgs::srv::dds_::ControlModeCommand_Request_"):
    client: uint64
    number: int64
    stamp: Time
    mode: uint8


@dataclass
class ControlModeResponse(IdlStruct, typename="autoware_vehicle_msgs::srv::dds_::ControlModeCommand_Response_"):
    client: uint64
    number: int64
    success: bool
