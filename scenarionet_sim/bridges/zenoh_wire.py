"""Topics of ROS 2 over zenoh, with the key expressions, liveliness tokens and attachments of rmw_zenoh.

Source: ros2/rmw_zenoh, ``docs/design.md``.
"""

from __future__ import annotations

import json
import os
import struct
import time
from collections.abc import Mapping
from itertools import count
from typing import Any

from scenarionet_data.errors import MissingDependency, SourceError
from scenarionet_data.interchange.ros.messages import messages
from scenarionet_sim.bridges.inbox import Inbox
from scenarionet_sim.bridges.ros2_names import dds_name

ENDPOINT = "tcp/127.0.0.1:7447"
"""Where nodes of rmw_zenoh look for a router, which this is without ``ZENOH_SESSION_CONFIG_URI``."""

_QOS = "::,10:,:,:,,"  # reliable, volatile, keep last 10


def key_expression(domain: int, topic: str, kind: str) -> str:
    """Return the key of a topic: domain, name, type and hash of the type."""
    return f"{domain}/{topic}/{dds_name(kind)}/{messages(2).store.hash_rihs01(kind)}"


class ZenohWire:
    """A session with a publisher or a subscriber for each topic.

    Args:
        published, subscribed: Types of topics by name.
        inbox: Gets what the subscribers get.
        domain: Number of the domain.

    Raises:
        MissingDependency: eclipse-zenoh is not installed.
        SourceError: The port is taken.
    """

    def __init__(self, published: Mapping[str, str], subscribed: Mapping[str, str], inbox: Inbox, domain: int) -> None:
        try:
            import zenoh
        except ModuleNotFoundError as error:
            raise MissingDependency("ROS 2 over zenoh needs eclipse-zenoh", "ros") from error
        path = os.environ.get("ZENOH_SESSION_CONFIG_URI")
        config = zenoh.Config.from_file(path) if path else zenoh.Config()
        if not path:
            for key, value in (
                ("mode", "router"),
                ("listen/endpoints", [ENDPOINT]),
                ("listen/exit_on_failure", True),
                ("scouting/multicast/enabled", False),
            ):
                config.insert_json5(key, json.dumps(value))
        try:
            self._session: Any = zenoh.open(config)
        except zenoh.ZError as error:
            raise SourceError(
                f"zenoh does not open {path or ENDPOINT}: {error}; end the router that runs there, or name a "
                "configuration of a client in ZENOH_SESSION_CONFIG_URI"
            ) from error
        self._numbers, self._gid = count(1), os.urandom(16)
        # A router delivers to everybody. Callbacks run in zenoh's own threads: Python's, the default, are not daemons,
        # and the interpreter would wait for them at its end.
        self._publishers = {
            name: self._session.declare_publisher(
                key_expression(domain, name, kind),
                congestion_control=zenoh.CongestionControl.BLOCK,  # lockstep waits for every message
                express=True,
            )
            for name, kind in published.items()
        }

        def putting(name: str) -> Any:
            return zenoh.handlers.Callback(lambda sample: inbox.put(name, bytes(sample.payload)), indirect=False)

        self._subscribers = [
            self._session.declare_subscriber(key_expression(domain, name, kind), putting(name))
            for name, kind in subscribed.items()
        ]
        node = f"@ros2_lv/{domain}/{self._session.zid()}/0"
        named = [("MP", *each) for each in published.items()] + [("MS", *each) for each in subscribed.items()]
        tokens = [f"{node}/0/NN/%/%/scenarionet"]
        for number, (role, name, kind) in enumerate(named, 1):
            mangled, digest = name.replace("/", "%"), messages(2).store.hash_rihs01(kind)
            tokens.append(f"{node}/{number}/{role}/%/%/scenarionet/%{mangled}/{dds_name(kind)}/{digest}/{_QOS}")
        self._tokens = [self._session.liveliness().declare_token(token) for token in tokens]

    def publish(self, topic: str, content: bytes) -> None:
        """Send a message, with number, time [ns] and sender as its attachment."""
        attachment = struct.pack("<qqB16s", next(self._numbers), time.time_ns(), len(self._gid), self._gid)
        self._publishers[topic].put(content, attachment=attachment)

    def close(self) -> None:
        """Close the session."""
        self._session.close()
