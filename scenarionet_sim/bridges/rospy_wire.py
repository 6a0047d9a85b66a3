"""Topics of ROS 1 over TCPROS, by the rospy of Debian or of a ROS installation."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from functools import cache
from typing import Any

from scenarionet_data.errors import MissingDependency, SourceError
from scenarionet_data.interchange.ros.messages import messages
from scenarionet_sim.bridges.inbox import Inbox

DEBIAN = "/usr/lib/python3/dist-packages"
"""Where Debian has rospy; it is looked up there last, as other packages there may be older than ours."""


class RospyWire:
    """A node with a publisher or a subscriber for each topic; a process has one for its life.

    Without ``ROS_MASTER_URI`` and ``ROS_IP`` it is on this machine alone.

    Args:
        published, subscribed: Types of topics by name.
        inbox: Gets what the subscribers get.
        domain: ROS 1 has none.

    Raises:
        MissingDependency: rospy is not installed.
        SourceError: There is no master.
    """

    def __init__(self, published: Mapping[str, str], subscribed: Mapping[str, str], inbox: Inbox, domain: int) -> None:
        del domain
        sys.path.append(DEBIAN)
        try:
            import rosgraph
            import rospy
        except ModuleNotFoundError as error:
            packages = "apt-get install python3-rospy python3-rosmaster"
            raise MissingDependency(f"ROS 1 needs rospy ({error})", "", packages) from error
        finally:
            sys.path.remove(DEBIAN)
        master = os.environ.setdefault("ROS_MASTER_URI", "http://127.0.0.1:11311")
        os.environ.setdefault("ROS_IP", "127.0.0.1")
        if not rosgraph.is_master_online():
            raise SourceError(f"there is no ROS master at {master}; start `rosmaster --core`, or set ROS_MASTER_URI")
        rospy.init_node("scenarionet", anonymous=True, disable_signals=True, disable_rosout=True, disable_rostime=True)
        self._publishers = {
            name: rospy.Publisher(f"/{name}", raw_type(kind), queue_size=10, tcp_nodelay=True)
            for name, kind in published.items()
        }

        def putting(name: str) -> Any:
            return lambda message: inbox.put(name, message.content)

        self._subscribers = [
            rospy.Subscriber(f"/{name}", raw_type(kind), putting(name), tcp_nodelay=True)
            for name, kind in subscribed.items()
        ]

    def publish(self, topic: str, content: bytes) -> None:
        """Send a message."""
        publisher = self._publishers[topic]
        publisher.publish(publisher.data_class(content))

    def close(self) -> None:
        """Leave the topics."""
        for end in (*self._publishers.values(), *self._subscribers):
            end.unregister()


@cache
def raw_type(kind: str) -> Any:
    """Return a class of rospy for messages of a type that are bytes already, from the definition that rosbags has."""
    import genpy

    class Raw(genpy.Message):  # type: ignore[misc]  # genpy has no types
        """A message as it is on the wire."""

        __slots__ = ("content",)
        _type = kind.replace("/msg/", "/")
        _full_text, _md5sum = messages(1).store.generate_msgdef(kind, ros_version=1)
        _slot_types = ("uint8[]",)

        def __init__(self, content: bytes = b"") -> None:
            self.content = content

        def serialize(self, buffer: Any) -> None:
            buffer.write(self.content)

        def deserialize(self, content: Any) -> Any:
            self.content = bytes(content)
            return self

    return Raw
