"""Driving stacks as planners, by name: ``ros2:zenoh+camera+lidar``, ``autoware:dds+realtime``, ``openpilot:msgq``."""

from __future__ import annotations

import atexit
from collections.abc import Callable, Collection
from functools import cache
from typing import NamedTuple

from scenarionet_data.errors import BadParameter
from scenarionet_sim.bridges.autoware_transport import AutowareTransport
from scenarionet_sim.bridges.link import Link, Transport
from scenarionet_sim.bridges.openpilot.transport import OpenpilotTransport
from scenarionet_sim.bridges.ros_topics import OPTIONS
from scenarionet_sim.bridges.ros_transport import RosTransport
from scenarionet_sim.bridges.sensing import SENSORS, StackSensors
from scenarionet_sim.planners.base import Action, Planner, Trajectory
from scenarionet_sim.planners.view import View

REALTIME = "realtime"
"""Option of every stack: keep to the wall clock instead of lockstep."""

TRANSPORTS: dict[str, Callable[[Collection[str]], Transport]] = {
    "ros2:dds": lambda options: RosTransport(2, "dds", options),
    "ros2:zenoh": lambda options: RosTransport(2, "zenoh", options),
    "ros1:tcp": lambda options: RosTransport(1, "tcp", options),
    "autoware:dds": AutowareTransport,
    "openpilot:msgq": OpenpilotTransport,
}
"""What speaks to each kind of stack."""


class Stack(NamedTuple):
    """A stack: a name in TRANSPORTS, and its options."""

    kind: str
    options: tuple[str, ...]

    @classmethod
    def parse(cls, policy: str) -> Stack:
        """Return the stack of the name of a policy.

        Raises:
            BadParameter: There is no such stack or option.
        """
        kind, *options = policy.split("+")
        if kind not in TRANSPORTS:
            raise BadParameter(f"unknown policy {policy!r}; choose from {', '.join(TRANSPORTS)}")
        known = (*(OPTIONS if kind.startswith("ros") else ()), REALTIME)
        for option in options:
            if option not in known:
                raise BadParameter(f"{policy}: {kind} has no option {option!r}; choose from {', '.join(known)}")
        return cls(kind, tuple(options))


def is_stack(policy: str) -> bool:
    """Return whether the name of a policy is that of a stack."""
    return policy.partition(":")[0] in {kind.partition(":")[0] for kind in TRANSPORTS}


class StackPlanner(Planner):
    """Asks the stack at each moment.

    Args:
        policy: Its name.

    Raises:
        BadParameter: There is no such stack.
    """

    def __init__(self, policy: str) -> None:
        self._stack, self._is_first = Stack.parse(policy), True
        options = self._stack.options
        wanted = {*options, "camera"} if "compressed" in options else options
        self._sensing = StackSensors({name: sensor for name, sensor in SENSORS.items() if name in wanted})

    def act(self, view: View) -> Action | Trajectory:
        """Return what the stack tells the vehicle to do."""
        is_first, self._is_first = self._is_first, False
        return link(self._stack).ask(view, self._sensing.look(view), is_first=is_first)


@cache
def link(stack: Stack) -> Link:
    """Return the connection of this process to a stack; it stays open from scenario to scenario."""
    options = tuple(option for option in stack.options if option != REALTIME)
    transport = TRANSPORTS[stack.kind](options)
    atexit.register(transport.close)
    return Link(transport, is_realtime=REALTIME in stack.options)
