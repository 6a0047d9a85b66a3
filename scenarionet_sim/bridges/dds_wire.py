"""Topics of ROS 2 over DDS, by cyclonedds, as rmw_cyclonedds names and types them."""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping
from functools import cache
from typing import Any

from scenarionet_data.errors import MissingDependency
from scenarionet_data.interchange.ros.messages import messages
from scenarionet_sim.bridges.inbox import Inbox
from scenarionet_sim.bridges.ros2_names import dds_name

LOOPBACK = (
    "<CycloneDDS><Domain><General><Interfaces><NetworkInterface address='127.0.0.1'/></Interfaces>"
    "<AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex>"
    "<MaxAutoParticipantIndex>32</MaxAutoParticipantIndex><Peers><Peer address='127.0.0.1'/></Peers></Discovery>"
    "</Domain></CycloneDDS>"
)
"""Configuration without ``CYCLONEDDS_URI``: this machine alone, as with ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST."""


class DdsWire:
    """A participant with a writer and a reader for each topic, reliable, with a history of 10.

    Args:
        published, subscribed: Types of topics by name; those of a service begin with ``rq/`` and ``rr/``.
        inbox: Gets what the readers read.
        domain: Number of the domain.
        latched: Topics of which a reader gets the last message that was written before it was there.

    Raises:
        MissingDependency: cyclonedds is not installed.
    """

    def __init__(
        self,
        published: Mapping[str, str],
        subscribed: Mapping[str, str],
        inbox: Inbox,
        domain: int,
        latched: Collection[str] = (),
    ) -> None:
        try:
            from cyclonedds.core import Listener, Policy, Qos
            from cyclonedds.domain import DomainParticipant
            from cyclonedds.pub import DataWriter
            from cyclonedds.sub import DataReader
            from cyclonedds.topic import Topic
            from cyclonedds.util import duration
        except ModuleNotFoundError as error:
            raise MissingDependency("ROS 2 over DDS needs cyclonedds", "ros") from error
        if not os.environ.get("CYCLONEDDS_URI"):
            _keep_to_loopback(domain)
        participant = DomainParticipant(domain)
        common = Qos(
            Policy.Reliability.Reliable(duration(seconds=1)),
            Policy.History.KeepLast(10),
            Policy.DataRepresentation(use_cdrv0_representation=True),
        )
        kept = Qos(Policy.Durability.TransientLocal, base=common)

        def made(end: Any, name: str, kind: str, **settings: Any) -> Any:
            qos = kept if name in latched else common
            of_dds = name if name.startswith(("rq/", "rr/")) else f"rt/{name}"
            return end(participant, Topic(participant, of_dds, idl_type(kind), qos=qos), qos=qos, **settings)

        self._writers: dict[str, Any] = {name: made(DataWriter, name, kind) for name, kind in published.items()}

        def listener(name: str) -> Any:
            def read(reader: Any) -> None:
                for sample in reader.take(100):
                    if isinstance(sample, _Content):
                        inbox.put(name, sample.content)

            return Listener(on_data_available=read)

        self._readers = [made(DataReader, name, kind, listener=listener(name)) for name, kind in subscribed.items()]
        self._participant: Any = participant

    def publish(self, topic: str, content: bytes) -> None:
        """Send a message."""
        writer = self._writers[topic]
        sample = object.__new__(writer.data_type)
        sample.serialize = lambda **_: content  # it is CDR already
        writer.write(sample)

    def close(self) -> None:
        """Delete the participant."""
        self._readers, self._writers, self._participant = [], {}, None


class _Content:
    """A message as it was read.

    Attributes:
        content: CDR.
        sample_info: Of cyclonedds, which sets it.
    """

    def __init__(self, content: bytes) -> None:
        self.content, self.sample_info = content, None


@cache
def _keep_to_loopback(domain: int) -> Any:
    """Configure a domain; once for all participants of this process, as it cannot be configured again."""
    from cyclonedds.domain import Domain

    return Domain(domain, LOOPBACK)


@cache
def idl_type(kind: str) -> Any:
    """Return the type of cyclonedds of a message, from the definition that rosbags has; it reads and writes CDR."""
    from cyclonedds import idl

    _, fields = messages(2).store.fielddefs[kind]
    made: Any = idl.make_idl_struct(
        kind.rpartition("/")[2], dds_name(kind), {name: _idl_field(*field) for name, field in fields}
    )
    made.deserialize = lambda content, **_: _Content(bytes(content))
    return made


def _idl_field(node: Any, given: Any) -> Any:
    """Return the type of a field; ``node`` and ``given`` as in ``fielddefs`` of rosbags."""
    from cyclonedds.idl import types
    from rosbags.interfaces import Nodetype

    if node == Nodetype.NAME:
        return idl_type(given)
    if node == Nodetype.BASE:
        name, bound = given
        if name == "string":
            return types.bounded_str[bound] if bound else str
        return bool if name == "bool" else getattr(types, {"byte": "byte", "char": "uint8"}.get(name, name))
    inner, count = _idl_field(*given[0]), given[1]
    if node == Nodetype.ARRAY:
        return types.array[inner, count]
    return types.sequence[inner, count] if count else types.sequence[inner]
