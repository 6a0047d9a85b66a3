"""Stacks of ROS over one of three wires."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection

from scenarionet_data.interchange.ros.messages import messages
from scenarionet_sim.bridges.commands import Command
from scenarionet_sim.bridges.dds_wire import DdsWire
from scenarionet_sim.bridges.inbox import Inbox, Wire
from scenarionet_sim.bridges.link import StackMoment
from scenarionet_sim.bridges.ros_topics import ANSWERS, decode, moment_messages, topics
from scenarionet_sim.bridges.rospy_wire import RospyWire
from scenarionet_sim.bridges.zenoh_wire import ZenohWire

WIRES: dict[str, Callable[..., Wire]] = {"dds": DdsWire, "zenoh": ZenohWire, "tcp": RospyWire}


class RosTransport:
    """Topics of ROS; see :class:`~scenarionet_sim.bridges.link.Transport`.

    Args:
        version: 1 or 2.
        wire: A name in WIRES.
        options: Names in ``ros_topics.OPTIONS``.
    """

    def __init__(self, version: int, wire: str, options: Collection[str] = ()) -> None:
        domain = int(os.environ.get("ROS_DOMAIN_ID", "0"))
        place = f"in domain {domain} " if version == 2 else ""
        self.where = f"{wire} {place}on {', '.join(f'/{name}' for name in ANSWERS)}"
        self._ros, self._inbox, self._topics = messages(version), Inbox(), topics(version, options)
        answers = {name: topic.kind for name, topic in ANSWERS.items()}
        self._wire = WIRES[wire](self._topics, answers, self._inbox, domain)

    def begin(self, moment: StackMoment, until: float) -> int:
        """Begin at once."""
        del until
        return moment.stamp

    def send(self, moment: StackMoment) -> None:
        """Publish the messages of a moment."""
        for topic, message in moment_messages(self._ros, moment, self._topics):
            self._wire.publish(topic, self._ros.encode(message))

    def take(self, until: float) -> tuple[int, Command] | None:
        """Return the oldest answer that comes in time."""
        received = self._inbox.take(until)
        return None if received is None else decode(self._ros, *received)

    def close(self) -> None:
        """Close the wire."""
        self._wire.close()
