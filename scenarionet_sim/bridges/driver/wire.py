"""Messages of ``driver.proto`` over a socket, and moments as such messages."""

from __future__ import annotations

import socket
import struct
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from scenarionet_data.errors import BadParameter, MissingDependency, SourceError
from scenarionet_sim.planners.base import Action, Trajectory
from scenarionet_sim.planners.view import View

LARGEST = 1 << 24
"""Longest answer that is read [bytes]."""

_LENGTH = struct.Struct("<I")


@cache
def message(name: str) -> Any:
    """Return the class of a message of ``driver.proto``.

    Raises:
        MissingDependency: protobuf is not installed.
    """
    try:
        from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
    except ModuleNotFoundError as error:
        raise MissingDependency("drivers in other processes need protobuf", "driver") from error
    files = descriptor_pb2.FileDescriptorSet.FromString((Path(__file__).parent / "driver.binpb").read_bytes())
    pool = descriptor_pool.Default()
    pool.AddSerializedFile(files.file[0].SerializeToString())
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(f"scenarionet.driver.v1.{name}"))


def send(connection: socket.socket, content: bytes) -> None:
    """Send a message."""
    connection.sendall(_LENGTH.pack(len(content)) + content)


def receive(connection: socket.socket) -> bytes:
    """Return the bytes of the next message.

    Raises:
        SourceError: The other side hangs up, or sends a length beyond LARGEST.
        TimeoutError: Nothing comes within the socket's time limit.
    """
    (length,) = _LENGTH.unpack(_exactly(connection, _LENGTH.size))
    if length > LARGEST:
        raise SourceError(f"the driver began a message of {length:,} bytes; expected at most {LARGEST:,}")
    return _exactly(connection, length)


def _exactly(connection: socket.socket, count: int) -> bytes:
    content = bytearray()
    while len(content) < count:
        part = connection.recv(count - len(content))
        if not part:
            raise SourceError(f"the driver hung up after {len(content)} of {count} bytes of a message")
        content += part
    return bytes(content)


def fill(moment: Any, view: View, episode: int, *, is_first: bool) -> None:
    """Fill a message with a moment.

    Args:
        moment: The empty message ``Moment``.
        view: In the scenario's frame.
        episode: Its number.
        is_first: Whether the episode begins.
    """
    route, ego, seen = view.route, view.ego, view.objects
    moment.episode, moment.time = episode, view.time
    if is_first:
        begin = moment.begin
        begin.scenario, begin.dt = view.scenario_id, view.dt
        for field, values in (
            (begin.route_x, route.centreline[:, 0]),
            (begin.route_y, route.centreline[:, 1]),
            (begin.route_heading, route.heading),
            (begin.speed_limit, route.speed_limit),
            (begin.beyond_x, route.beyond[:, 0]),
            (begin.beyond_y, route.beyond[:, 1]),
            (begin.stop_arc, route.stop_arc),
        ):
            field.extend(values.tolist())
    own = moment.ego
    own.x, own.y, own.heading, own.speed = ego.x, ego.y, ego.heading, ego.speed
    own.acceleration, own.yaw_rate, own.length, own.width = ego.acceleration, ego.yaw_rate, ego.length, ego.width
    own.route_position, own.route_offset = route.position, route.lateral
    moment.stop_color.extend(view.lights.color[route.stop_light].tolist())
    others = moment.objects
    for field, values in (
        (others.id, seen.rows),
        (others.type, seen.object_type),
        (others.x, seen.position[:, 0]),
        (others.y, seen.position[:, 1]),
        (others.heading, seen.heading),
        (others.velocity_x, seen.velocity[:, 0]),
        (others.velocity_y, seen.velocity[:, 1]),
        (others.length, seen.size[:, 0]),
        (others.width, seen.size[:, 1]),
    ):
        field.extend(values.tolist())


def read(command: Any) -> Action | Trajectory:
    """Return what a message ``Command`` tells the vehicle to do.

    Raises:
        SourceError: It tells nothing, or of an error.
        BadParameter: A number is not finite, or the plan is no trajectory.
    """
    kind = command.WhichOneof("drive")
    if kind == "action":
        answer = command.action.steering, command.action.throttle
        if not np.isfinite(answer).all():
            raise BadParameter(f"the driver asks for steering and throttle {answer}; expected finite numbers")
        return answer
    if kind == "plan":
        plan = command.plan
        counts = {len(each) for each in (plan.x, plan.y, plan.heading, plan.time)}
        if len(counts) > 1:
            raise BadParameter(
                f"the driver's plan has {sorted(counts)} values of x, y, heading and time; expected as many"
            )
        return Trajectory(np.column_stack([plan.x, plan.y, plan.heading]), np.array(plan.time))
    raise SourceError(f"the driver says: {command.error}" if kind else "the driver's command has no action and no plan")
