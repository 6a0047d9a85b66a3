"""A node on Autoware's topics and services with cyclonedds alone: a lane keeper that follows and stops at red.

Arguments: the Lanelet2 map, and the node's fault.
"""

import math
import sys
import time
from itertools import pairwise

import autoware_messages as aw
from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from idl_messages import QOS, Clock, Odometry, Time
from lanelets import Lanelets

UNSET, SET = 1, 2
STOP, AUTONOMOUS = 1, 2
RED, AMBER, DRIVE = 1, 2, 2

participant = DomainParticipant(0)
LATCHED = Qos(Policy.Durability.TransientLocal, base=QOS)


def reader(name, kind, prefix="rt/"):
    return DataReader(participant, Topic(participant, prefix + name, kind, qos=QOS), qos=QOS)


def writer(name, kind, prefix="rt/", qos=LATCHED):
    return DataWriter(participant, Topic(participant, prefix + name, kind, qos=qos), qos=qos)


def served(name, request, response):
    return reader(f"{name}Request", request, "rq/"), writer(f"{name}Reply", response, "rr/", QOS)


class Node:
    def __init__(self, lanelets, fault):
        self.lanelets, self.fault = lanelets, fault
        self.clock = reader("clock", Clock)
        self.states = {
            "pose": reader("localization/kinematic_state", Odometry),
            "objects": reader("perception/object_recognition/objects", aw.PredictedObjects),
            "lights": reader("perception/traffic_light_recognition/traffic_signals", aw.TrafficLightGroupArray),
            "mode": reader("vehicle/status/control_mode", aw.ControlModeReport),
            "gear": reader("vehicle/status/gear_status", aw.GearReport),
            "speed": reader("vehicle/status/velocity_status", aw.VelocityReport),
            "steering": reader("vehicle/status/steering_status", aw.SteeringReport),
            "acceleration": reader("localization/acceleration", aw.AccelWithCovarianceStamped),
        }
        self.now = {}
        self.control = writer("control/command/control_cmd", aw.Control)
        self.gear = writer("control/command/gear_cmd", aw.GearCommand)
        self.engage = writer("vehicle/engage", aw.Engage)
        self.route_state = writer("api/routing/state", aw.RouteState)
        self.operation_mode = writer("api/operation_mode/state", aw.OperationModeState)
        change = aw.ChangeOperationModeRequest, aw.ChangeOperationModeResponse
        self.services = [
            (*served("api/operation_mode/change_to_stop", *change), aw.ChangeOperationModeResponse, self.stop),
            (*served("api/operation_mode/change_to_autonomous", *change), aw.ChangeOperationModeResponse, self.start),
            (*served("api/routing/clear_route", aw.ClearRouteRequest, aw.ClearRouteResponse), aw.ClearRouteResponse,
             self.clear),
            (*served("api/routing/set_route_points", aw.SetRoutePointsRequest, aw.SetRoutePointsResponse),
             aw.SetRoutePointsResponse, self.plan),
        ]  # fmt: skip
        self.mode_request = writer("control/control_mode_requestRequest", aw.ControlModeRequest, "rq/", QOS)
        self.mode_reply = reader("control/control_mode_requestReply", aw.ControlModeResponse, "rr/")
        self.path, self.limit, self.cruise, self.mode = None, None, None, STOP
        self.decided = None, None
        self.tell()

    def tell(self):
        stamp = Time(0, 0)
        self.route_state.write(aw.RouteState(stamp, SET if self.path else UNSET))
        drives = self.mode == AUTONOMOUS
        self.operation_mode.write(
            aw.OperationModeState(stamp, self.mode, drives, False, True, bool(self.path), False, False)
        )

    def stop(self, _):
        self.mode = STOP

    def clear(self, _):
        self.path = None

    def plan(self, request):
        if self.path:
            return aw.ResponseStatus(False, 1, "a route exists")
        if "pose" not in self.now:
            return aw.ResponseStatus(False, 2, "there is no localisation yet")
        odometry = self.now["pose"].pose.pose
        start, goal = (
            (at.position.x, at.position.y, 2.0 * math.atan2(at.orientation.z, at.orientation.w))
            for at in (odometry, request.goal)
        )
        found = self.lanelets.route(start, goal)
        if found is None:
            return aw.ResponseStatus(False, 3, "the lanelets do not lead there")
        (self.path, self.limit), self.cruise = found, None
        return None

    def start(self, _):
        """Ask the vehicle for control, as an operation mode manager does, and engage."""
        if not self.path or self.fault == "unready":
            return aw.ResponseStatus(False, 1, "no route")
        self.mode_request.write(aw.ControlModeRequest(77, 1, Time(0, 0), 1))
        end = time.monotonic() + 2.0
        while time.monotonic() < end:
            for reply in self.mode_reply.take(10):
                if (reply.client, reply.number, reply.success) == (77, 1, True):
                    self.engage.write(aw.Engage(Time(0, 0), self.fault != "disengaged"))
                    self.gear.write(aw.GearCommand(Time(0, 0), DRIVE if self.fault != "parked" else 22))
                    self.mode = AUTONOMOUS
                    return None
            time.sleep(0.001)
        return aw.ResponseStatus(False, 2, "the vehicle does not give control")

    def serve(self):
        for requests, replies, kind, do in self.services:
            for request in requests.take(10):
                status = do(request) or aw.ResponseStatus(True, 0, "")
                self.tell()
                replies.write(kind(request.client, request.number, status))

    def listen(self):
        for name, each in self.states.items():
            for sample in each.take(20):
                self.now[name] = sample

    def run(self):
        while True:
            self.serve()
            *_, clock = [None, *self.clock.take(20)]  # the newest
            self.listen()
            if clock is None:
                time.sleep(0.0005)
                continue
            end = time.monotonic() + 0.1
            while not self.is_whole(clock.clock) and time.monotonic() < end:
                self.listen()
            if self.mode == AUTONOMOUS and self.path and self.is_whole(clock.clock):
                self.drive(clock.clock)

    def is_whole(self, stamp):
        """Whether all of a moment is here; topics have no order among each other."""
        parts = [self.now.get(name) for name in ("pose", "objects", "speed", "lights")]
        return all(part and getattr(part, "header", part).stamp == stamp for part in parts)

    def drive(self, stamp):
        if self.fault == "silent":
            return
        if stamp != self.decided[0]:
            self.decided = stamp, self.decide()
        steering, acceleration = self.decided[1]
        if self.fault == "nan":
            steering = math.nan
        lateral = aw.Lateral(stamp, stamp, steering, 0.0, False)
        along = aw.Longitudinal(stamp, stamp, 0.0, acceleration, 0.0, True, False)
        self.control.write(aw.Control(stamp, stamp, lateral, along))

    def decide(self):
        """Pure pursuit of the path, and IDM behind what is on it or a red light."""
        pose, path = self.now["pose"].pose.pose, self.path
        x, y, speed = pose.position.x, pose.position.y, self.now["speed"].longitudinal_velocity
        heading = 2.0 * math.atan2(pose.orientation.z, pose.orientation.w)
        self.cruise = self.cruise or self.limit or max(speed, 8.0)
        nearest = min(range(len(path)), key=lambda k: math.dist(path[k], (x, y)))
        reach = 4.0 + 0.5 * speed
        ahead = next((p for p in path[nearest:] if math.dist(p, (x, y)) >= reach), None)
        if ahead is None:
            (ax, ay), (bx, by) = path[-2], path[-1]
            length = max(math.dist(path[-2], path[-1]), 1e-6)
            ahead = bx + (bx - ax) / length * reach, by + (by - ay) / length * reach
        dx, dy = ahead[0] - x, ahead[1] - y
        across = -math.sin(heading) * dx + math.cos(heading) * dy
        steering = math.atan(2.7 * 2.0 * across / (dx * dx + dy * dy))
        bend = abs(2.0 * across / (dx * dx + dy * dy))
        cruise = min(self.cruise, math.sqrt(2.0 / max(bend, 1e-3)))
        arcs, arc = [], 0.0
        for a, b in pairwise(path[nearest:]):
            arcs.append(arc)
            arc += math.dist(a, b)
        leaders = []
        for each in self.now["objects"].objects:
            at = each.kinematics.initial_pose_with_covariance.pose
            if math.dist((at.position.x, at.position.y), (x, y)) > 60.0 or not arcs:
                continue
            k = min(range(len(arcs)), key=lambda k: math.dist(path[nearest + k], (at.position.x, at.position.y)))
            aside = math.dist(path[nearest + k], (at.position.x, at.position.y))
            size = each.shape.dimensions
            if 0 < k < len(arcs) - 1 and aside < size.y / 2.0 + 1.2:
                linear = each.kinematics.initial_twist_with_covariance.twist.linear
                turned = 2.0 * math.atan2(at.orientation.z, at.orientation.w)
                (ax, ay), (bx, by) = path[nearest + k], path[nearest + k + 1]
                along = math.cos(turned - math.atan2(by - ay, bx - ax)) * linear.x
                leaders.append((arcs[k] - 4.0 - size.x / 2.0, along))
        groups = self.now["lights"].traffic_light_groups
        colors = {each.traffic_light_group_id: each.elements[0].color for each in groups}
        for number, stops in self.lanelets.lights.items():
            for stop in stops if colors.get(number) in (RED, AMBER) else ():
                k = min(range(len(arcs)), key=lambda k: math.dist(path[nearest + k], stop), default=0)
                gap = arcs[k] - 4.0 if arcs else -1.0
                if k and math.dist(path[nearest + k], stop) < 1.5 and gap > speed * speed / 8.0:
                    leaders.append((gap, 0.0))
        pull = 1.5 * (1.0 - (speed / cruise) ** 4)
        for gap, other in leaders:
            wanted = 2.0 + max(0.0, 1.2 * speed + speed * (speed - other) / (2.0 * math.sqrt(1.5 * 2.5)))
            pull = min(pull, 1.5 * (1.0 - (speed / cruise) ** 4 - (wanted / max(gap, 0.3)) ** 2))
        return steering, max(pull, -7.0)


Node(Lanelets(sys.argv[1]), sys.argv[2] if len(sys.argv) > 2 else "").run()
