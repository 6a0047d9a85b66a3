"""A driving stack with cyclonedds alone: /route, /odom, /clock in, /ackermann_cmd out. Argument: its fault."""

import math
import sys
from dataclasses import dataclass

from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import float32
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration
from idl_messages import QOS, Clock, Header, Odometry, Path, Time
from pursuit import Pursuit


@dataclass
class AckermannDrive(IdlStruct, typename="ackermann_msgs::msg::dds_::AckermannDrive_"):
    steering_angle: float32
    steering_angle_velocity: float32
    speed: float32
    acceleration: float32
    jerk: float32


@dataclass
class AckermannDriveStamped(IdlStruct, typename="ackermann_msgs::msg::dds_::AckermannDriveStamped_"):
    header: Header
    drive: AckermannDrive


fault = sys.argv[1] if len(sys.argv) > 1 else ""
participant = DomainParticipant(1 if fault == "domain" else 0)


def reader(name, kind):
    return DataReader(participant, Topic(participant, name, kind, qos=QOS), qos=QOS)


routes, poses, clocks = reader("rt/route", Path), reader("rt/odom", Odometry), reader("rt/clock", Clock)
answers = DataWriter(participant, Topic(participant, "rt/ackermann_cmd", AckermannDriveStamped, qos=QOS), qos=QOS)
route, pose, driver = None, None, Pursuit()
while True:
    for clock in clocks.take_iter(timeout=duration(seconds=60)):
        for path in routes.take(10):
            places = [(each.pose.position.x, each.pose.position.y) for each in path.poses]
            if places != route:
                route, driver = places, Pursuit()
        for each in poses.take(10):
            pose = each
        if route is None or pose is None or pose.header.stamp != clock.clock or fault == "silent":
            continue
        at, turn = pose.pose.pose.position, pose.pose.pose.orientation
        heading = 2.0 * math.atan2(turn.z, turn.w)
        steering, speed = driver.command(at.x, at.y, heading, pose.twist.twist.linear.x, route)
        if fault == "nan":
            speed = math.nan
        if fault == "dies" and clock.clock.sec >= 1:
            sys.exit(3)
        stamp = Time(0, 1) if fault == "old" else clock.clock
        for _ in range(300 if fault == "flood" else 0):
            answers.write(AckermannDriveStamped(Header(Time(0, 1), ""), AckermannDrive(0.0, 0.0, 0.0, 0.0, 0.0)))
        answers.write(AckermannDriveStamped(Header(stamp, ""), AckermannDrive(steering, 0.0, speed, 0.0, 0.0)))
