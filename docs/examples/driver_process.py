"""A driver in its own process: python driver_process.py PORT|SOCKET DRIVER.BINPB; then sim --policy driver:PORT."""

import math
import socket
import struct
import sys
from pathlib import Path

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory


def messages(file, *names):
    """Classes of messages, as `protoc --python_out` would write them into a module."""
    pool, content = descriptor_pool.DescriptorPool(), Path(file).read_bytes()
    pool.AddSerializedFile(descriptor_pb2.FileDescriptorSet.FromString(content).file[0].SerializeToString())
    kinds = (pool.FindMessageTypeByName(f"scenarionet.driver.v1.{name}") for name in names)
    return map(message_factory.GetMessageClass, kinds)


def local(ego, x, y):
    """A point of the scenario's frame as the vehicle sees it."""
    dx, dy, cos, sin = x - ego.x, y - ego.y, math.cos(ego.heading), math.sin(ego.heading)
    return cos * dx + sin * dy, cos * dy - sin * dx


def drive(route, ego, blocked):
    """Steering and throttle to a point of the route (x, y) a second ahead, as in PurePursuitPlanner."""
    places, reach = (local(ego, *point) for point in route), max(4.0, ego.speed)
    x, y = next((p for p in places if p[0] > 0.0 and math.hypot(*p) >= reach), local(ego, *route[-1]))
    x += 0.3 * ego.length
    angle = math.atan(0.6 * ego.length * 2.0 * y / (x * x + y * y))
    throttle = -1.0 if blocked else 0.5 * (8.0 - ego.speed)
    return max(-1.0, min(1.0, angle / math.radians(40.0))), max(-1.0, min(1.0, throttle))


def is_blocked(ego, objects):
    """Whether an object is before the vehicle within the way that it needs to stop."""
    places = (local(ego, *place) for place in zip(objects.x, objects.y, strict=True))
    return any(0.0 < x < 8.0 + ego.speed**2 / 6.0 and abs(y) < 1.5 for x, y in places)


def main(place, file):
    """Answer the simulators that connect, one after the other."""
    moments_kind, commands_kind = messages(file, "Moments", "Commands")
    if place.isdecimal():
        server = socket.create_server(("127.0.0.1", int(place)))
        server.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    else:
        server = socket.socket(socket.AF_UNIX)
        server.bind(place)
        server.listen()
    while True:
        connection, routes = server.accept()[0], {}
        while head := connection.recv(4, socket.MSG_WAITALL):
            moments = moments_kind.FromString(connection.recv(struct.unpack("<I", head)[0], socket.MSG_WAITALL))
            answer = commands_kind()
            for moment in moments.moments:
                if moment.HasField("begin"):
                    begin = moment.begin
                    x, y = [*begin.route_x, *begin.beyond_x], [*begin.route_y, *begin.beyond_y]
                    routes[moment.episode] = list(zip(x, y, strict=True))
                blocked = is_blocked(moment.ego, moment.objects)
                command = answer.commands.add(episode=moment.episode)
                command.action.steering, command.action.throttle = drive(routes[moment.episode], moment.ego, blocked)
            content = answer.SerializeToString()
            connection.sendall(struct.pack("<I", len(content)) + content)


if __name__ == "__main__":
    main(*sys.argv[1:])
