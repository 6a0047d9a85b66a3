"""A driving stack of ROS 2 as a planner, in lockstep: it is sent a moment, and the simulation waits for its answer."""

from __future__ import annotations

import atexit
import math
import os
import time
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from scenarionet_data.errors import BadParameter, SourceError
from scenarionet_sim.backends.base import Drive
from scenarionet_sim.bridges.dds_wire import DdsWire
from scenarionet_sim.bridges.inbox import Inbox, Wire
from scenarionet_sim.bridges.ros2_messages import ANSWERS, PUBLISHED, encode, moment_messages, typestore
from scenarionet_sim.bridges.zenoh_wire import ZenohWire
from scenarionet_sim.planners.base import Action, Planner, Trajectory
from scenarionet_sim.planners.view import View

PREFIX = "ros2:"
"""Name of a policy that is a stack of ROS 2: ``ros2:dds`` or ``ros2:zenoh``."""

WIRES: dict[str, Callable[..., Wire]] = {"dds": DdsWire, "zenoh": ZenohWire}

LIMIT = 10.0
"""Longest wait for an answer [s]."""

_AGAIN = 0.5
"""A moment without an answer is sent again after this time [s]: stacks start late, and are restarted."""

_NS = 1e9


class Link:
    """The connection of this process to a stack, with one clock over all episodes.

    Args:
        wire: A name in WIRES.
        limit: Longest wait for an answer [s].

    Attributes:
        stamp: Of the latest moment [ns]; it only rises, as nodes refuse messages from before their last one.
    """

    def __init__(self, wire: str, limit: float = LIMIT) -> None:
        self.inbox, self.limit, self.stamp = Inbox(), limit, 0
        self._kind, self._domain = wire, int(os.environ.get("ROS_DOMAIN_ID", "0"))
        self._wire = WIRES[wire](PUBLISHED, ANSWERS, self.inbox, self._domain)
        atexit.register(self._wire.close)

    def ask(self, view: View, *, is_first: bool) -> tuple[str, Any]:
        """Send a moment and return topic and message of the answer to it.

        Raises:
            SourceError: No answer comes in time, or one is no message.
        """
        self.stamp += round(view.dt * _NS)
        moment = moment_messages(view, self.stamp, with_route=is_first)
        contents = {topic: encode(message) for topic, message in moment.items()}
        end, others = time.monotonic() + self.limit, 0
        while (now := time.monotonic()) < end:
            for topic, content in contents.items():
                self._wire.publish(topic, content)
            until = min(now + _AGAIN, end)
            while (received := self.inbox.take(until)) is not None and time.monotonic() < end:
                topic, content = received
                message = decode(topic, content)
                stamp = message.header.stamp
                if stamp.sec * 1_000_000_000 + stamp.nanosec == self.stamp:
                    return topic, message
                others += 1
        raise SourceError(
            f"the stack did not answer the moment {self.stamp / _NS:g} s within {self.limit:g} s on "
            f"{', '.join(f'/{name}' for name in ANSWERS)} over {self._kind} in domain {self._domain}"
            + (f"; {others} messages had other stamps: answer with that of /clock" if others else "; is it running?")
        )


def decode(topic: str, content: bytes) -> Any:
    """Return the message of an answer.

    Raises:
        SourceError: The content is no message of the topic's type.
    """
    try:
        return typestore().deserialize_cdr(content, ANSWERS[topic])
    except Exception as error:  # rosbags raises what its generated code happens to meet
        raise SourceError(
            f"{len(content)} bytes on /{topic} are no {ANSWERS[topic]} ({error or type(error).__name__}); compare the "
            "definitions of both sides"
        ) from error


def drive(topic: str, message: Any, view: View) -> Action | Trajectory:
    """Return what an answer tells the vehicle to do.

    A speed is reached as quickly as the vehicle can, or with the acceleration of an AckermannDrive that is not 0.

    Raises:
        BadParameter: A number is not finite, or a plan is no trajectory.
    """
    if topic == "plan":
        start = message.header.stamp
        rows = [(each.header.stamp, each.pose.position, each.pose.orientation) for each in message.poses]
        times = [stamp.sec - start.sec + (stamp.nanosec - start.nanosec) / _NS for stamp, _, _ in rows]
        poses = [(place.x, place.y, 2.0 * math.atan2(turn.z, turn.w)) for _, place, turn in rows]
        return Trajectory(np.array(poses), np.array(times))
    vehicle, speed_now = Drive(), view.ego.speed
    if topic == "cmd_vel":
        speed, limit = float(message.twist.linear.x), math.inf
        bend = vehicle.wheelbase * view.ego.length * float(message.twist.angular.z)
        steering = math.atan(bend / speed) if speed else 0.0
    else:
        command = message.drive
        speed, steering = float(command.speed), float(command.steering_angle)
        limit = abs(float(command.acceleration)) or math.inf
    if not (math.isfinite(speed) and math.isfinite(steering) and not math.isnan(limit)):
        raise BadParameter(f"/{topic} asks for speed {speed} m/s and steering {steering} rad; expected finite numbers")
    wanted = min(max((speed - speed_now) / view.dt, -limit), limit)
    throttle = wanted / (vehicle.acceleration if wanted > 0.0 else vehicle.braking)
    return [min(max(steering / vehicle.max_steer, -1.0), 1.0), min(max(throttle, -1.0), 1.0)]


class Ros2Planner(Planner):
    """Asks the stack at each moment.

    Args:
        wire: A name in WIRES.

    Raises:
        BadParameter: There is no such wire.
    """

    def __init__(self, wire: str) -> None:
        if wire not in WIRES:
            raise BadParameter(f"unknown policy {PREFIX + wire!r}; choose from {', '.join(PREFIX + w for w in WIRES)}")
        self._wire, self._is_first = wire, True

    def act(self, view: View) -> Action | Trajectory:
        """Return what the stack tells the vehicle to do."""
        topic, message = link(self._wire).ask(view, is_first=self._is_first)
        self._is_first = False
        return drive(topic, message, view)


@cache
def link(wire: str) -> Link:
    """Return the connection of this process over a wire; it stays open from scenario to scenario."""
    return Link(wire)
