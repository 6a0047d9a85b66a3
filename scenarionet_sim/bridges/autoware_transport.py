"""Autoware over DDS: its planning simulator, and the one who calls its AD API."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from typing import Any

from scenarionet_data.errors import SourceError
from scenarionet_data.interchange.ros.messages import messages
from scenarionet_sim.backends.base import Drive
from scenarionet_sim.bridges.autoware_topics import (
    ANSWERS,
    AUTONOMOUS,
    CALLED,
    MANUAL,
    SERVED,
    TOPICS,
    VehicleReports,
    behind,
    moment_messages,
)
from scenarionet_sim.bridges.commands import Command, Push, Steer
from scenarionet_sim.bridges.dds_wire import DdsWire
from scenarionet_sim.bridges.inbox import ROOM, Inbox
from scenarionet_sim.bridges.link import AGAIN, NS, StackMoment
from scenarionet_sim.bridges.ros_topics import decoded, nanoseconds

_TICK = 0.01  # [s] of the clock, and of time, while Autoware gets ready
_ROUTE, _MODE = "api/routing/state", "api/operation_mode/state"
_STOP, _DRIVES = 1, 2
_UNSET, _SET = 1, 2
_FREE_GEARS, _PARK = (0, 1), 22


class AutowareTransport:
    """Autoware's topics and services; see :class:`~scenarionet_sim.bridges.link.Transport`.

    Args:
        options: Empty: perception is told, not sensed.
    """

    def __init__(self, options: Collection[str] = ()) -> None:
        del options
        domain = int(os.environ.get("ROS_DOMAIN_ID", "0"))
        self.where = f"dds in domain {domain} on /control/command/control_cmd"
        self._ros, self._inbox, self._vehicle = messages(2), Inbox(), VehicleReports()
        self._states: dict[str, Any] = {}
        self._told = ""
        self._client, self._number = int.from_bytes(os.urandom(8), "little"), 0
        published = {name: topic.kind for name, topic in TOPICS.items()}
        published |= _ends(CALLED, "Request") | _ends(SERVED, "Response")
        self._kinds = {name: topic.kind for name, topic in ANSWERS.items()}
        self._kinds |= _ends(SERVED, "Request") | _ends(CALLED, "Response")
        self._wire = DdsWire(published, self._kinds, self._inbox, domain, (_ROUTE, _MODE))

    def begin(self, moment: StackMoment, until: float) -> int:
        """Have Autoware stop, take the route and drive, by its AD API; its clock runs on, and the scene stands."""
        view, self._vehicle = moment.view, VehicleReports()
        route, reach = view.route, Drive().wheelbase * view.ego.length / 2.0
        (x, y), heading = route.centreline[-1].tolist(), float(route.heading[-1])
        there = {
            "header": self._ros.header(moment.stamp, "map"),
            "option": self._ros.make("autoware_adapi_v1_msgs/RouteOption", allow_goal_modification=False),
            "goal": self._ros.pose(*behind(x, y, heading, reach), heading),
            "waypoints": [],
        }
        nothing: dict[str, Any] = {"structure_needs_at_least_one_member": 0}
        wanted: tuple[tuple[dict[str, Any], Callable[[], bool]], ...] = (
            (nothing, lambda: self._state(_MODE, "mode") == _STOP),
            (nothing, lambda: self._state(_ROUTE, "state") == _UNSET),
            (there, lambda: self._state(_ROUTE, "state") == _SET),
            (
                nothing,
                lambda: self._state(_MODE, "mode") == _DRIVES and self._state(_MODE, "is_autoware_control_enabled"),
            ),
        )
        stamp = moment.stamp
        for (service, kind), (request, is_done) in zip(CALLED.items(), wanted, strict=True):
            asked, self._told = 0.0, "is not answered"
            while not is_done():
                now = time.monotonic()
                if now > until:
                    raise SourceError(
                        f"Autoware does not get ready over {self.where.partition(' on ')[0]}: /{service} {self._told}; "
                        "is it running, with the map of this scenario?"
                    )
                if now > asked + AGAIN:
                    asked, self._number = now, self._number + 1
                    ids = {"client": self._client, "number": self._number}
                    self._send(f"rq/{service}Request", f"{kind}_Request", **ids, **request)
                stamp += round(_TICK * NS)
                self.send(replace(moment, stamp=stamp, is_ready=False))
                end = now + _TICK
                for _ in range(ROOM):
                    if is_done() or (received := self._inbox.take(end)) is None:
                        break
                    self._note(*received)
        return stamp + round(_TICK * NS)

    def send(self, moment: StackMoment) -> None:
        """Publish the messages of a moment."""
        for topic, message in moment_messages(self._ros, moment, self._vehicle):
            self._wire.publish(topic, self._ros.encode(message))

    def take(self, until: float) -> tuple[int, Command] | None:
        """Return the oldest control command that comes in time; what else comes before it is taken note of."""
        num_late = 0
        while num_late < ROOM and (received := self._inbox.take(until)) is not None:
            control = self._note(*received)
            if control is not None:
                return nanoseconds(control.stamp), self._command(control)
            num_late += time.monotonic() > until  # a flood does not end
        return None

    def close(self) -> None:
        """Close the wire."""
        self._wire.close()

    def _state(self, topic: str, field: str) -> Any:
        return getattr(self._states.get(topic), field, None)

    def _send(self, topic: str, kind: str, **fields: Any) -> None:
        self._wire.publish(topic, self._ros.encode(self._ros.make(kind, **fields)))

    def _note(self, topic: str, content: bytes) -> Any:
        """Take note of a message; return it if it is a control command."""
        message, vehicle = decoded(self._ros, topic, content, self._kinds[topic]), self._vehicle
        match topic.rpartition("/")[2]:
            case "control_cmd":
                return message
            case "gear_cmd":
                vehicle.gear = message.command
            case "turn_indicators_cmd":
                vehicle.indicators = message.command or vehicle.indicators
            case "hazard_lights_cmd":
                vehicle.hazard = message.command or vehicle.hazard
            case "engage":
                vehicle.mode = AUTONOMOUS if message.engage else MANUAL
            case "state":
                self._states[topic] = message
            case "control_mode_requestRequest":
                is_known = message.mode in (AUTONOMOUS, MANUAL)
                vehicle.mode = message.mode if is_known else vehicle.mode
                kind = f"{SERVED['control/control_mode_request']}_Response"
                ids = {"client": message.client, "number": message.number}
                self._send("rr/control/control_mode_requestReply", kind, success=is_known, **ids)
            case _ if (message.client, message.number) == (self._client, self._number):
                status = message.status
                self._told = "was answered, but the state did not follow"
                if not status.success:
                    self._told = f"was refused with code {status.code}: {status.message or 'no reason'}"
        return None

    def _command(self, control: Any) -> Command:
        """What a control command means in the gear and mode that the vehicle is in."""
        if self._vehicle.mode != AUTONOMOUS:
            raise SourceError("Autoware has given the vehicle to a driver (control mode MANUAL); nobody else drives it")
        along, steering = control.longitudinal, float(control.lateral.steering_tire_angle)
        if self._vehicle.gear == _PARK:
            return Push(steering, -Drive().braking)
        if self._vehicle.gear in _FREE_GEARS:
            return Push(steering, 0.0)
        if along.is_defined_acceleration:
            return Push(steering, float(along.acceleration))
        return Steer(steering, float(along.velocity))


def _ends(services: Mapping[str, str], part: str) -> dict[str, str]:
    """Topics that carry requests (or responses) of services as rmw_cyclonedds names them, and their types."""
    before, after = ("rq", "Request") if part == "Request" else ("rr", "Reply")
    kinds = {name: kind.replace("/srv/", "/srv/msg/") for name, kind in services.items()}
    return {f"{before}/{name}{after}": f"{kind}_{part}" for name, kind in kinds.items()}
