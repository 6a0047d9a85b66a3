"""What is taken from the user's openpilot: its schema, and the packages msgq, opendbc and pycapnp."""

from __future__ import annotations

import os
import runpy
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from scenarionet_data.errors import BadParameter, MissingDependency, SourceError

CHECKOUT = "OPENPILOT"
"""Variable that names the folder of a checkout of openpilot, which has the schema of its messages."""

RENAMED = {"roadCameraState": "narrowRoadCameraState"}
"""Services that openpilot of 2026 has another name for."""

_BESIDE = "", "msgq_repo", "opendbc_repo"
"""Where a checkout has msgq and opendbc; they are looked up there last."""


def schema_folder() -> Path:
    """Return the folder of ``log.capnp``.

    Raises:
        BadParameter: No checkout is named, or it has no such file.
    """
    root = os.environ.get(CHECKOUT, "")
    for folder in (Path(root, "openpilot/cereal"), Path(root, "cereal"), Path(root)):
        if root and (folder / "log.capnp").is_file():
            return folder
    found = f"{root} has no log.capnp" if root else "it is not set"
    raise BadParameter(f"{CHECKOUT} names the folder of a checkout of openpilot; {found}")


class Messaging:
    """Queues of openpilot's services, and what else of its code the bridge needs.

    Args:
        published: Services to send.
        subscribed: The service to receive.

    Raises:
        BadParameter: No checkout is named.
        MissingDependency: A package is not installed, or another one has its name.

    Attributes:
        can_packer: opendbc's class that makes CAN frames of a DBC.
        vision_server: msgq's class that serves frames.
    """

    def __init__(self, published: Iterable[str], subscribed: str) -> None:
        folder = schema_folder()
        sys.path += [str(Path(os.environ[CHECKOUT], name)) for name in _BESIDE]
        try:
            import capnp
            import msgq
            import opendbc
            from msgq.visionipc import VisionIpcServer
            from opendbc.can.packer import CANPacker
        except ImportError as error:  # the package index has another msgq, without these names
            need = f"openpilot needs pycapnp, opendbc and comma's msgq ({error})"
            place = "install scenarionet-lake in openpilot's own environment, which has them"
            raise MissingDependency(need, "", place) from error
        self.can_packer, self.vision_server = CANPacker, VisionIpcServer
        self._is_taken, self._is_wrong, self._subscribed = msgq.IpcError, capnp.KjException, subscribed
        capnp.remove_import_hook()
        car = Path(opendbc.__file__).parent / "car"  # has car.capnp where the checkout has not
        # opendbc may have loaded a car.capnp of another version; a parser of its own, which schemas live by, has none.
        self._parser = capnp.SchemaParser()
        self._event = self._parser.load(str(folder / "log.capnp"), imports=[str(car)]).Event
        kinds = self._event.schema.fields
        self._names = {name: RENAMED[name] if RENAMED.get(name) in kinds else name for name in published}
        self._fields: dict[str, Any] = {}
        services = runpy.run_path(str(folder / "services.py"))["SERVICE_LIST"]

        def size_of(service: str) -> tuple[int, ...]:  # both sides must agree; empty for msgq's own
            return tuple(filter(None, [int(getattr(services.get(service), "queue_size", 0))]))

        self._publishers = {name: msgq.pub_sock(known, *size_of(known)) for name, known in self._names.items()}
        # It looks again every 2 ms, as a wake-up may come just before it waits.
        size = dict(zip(("segment_size",), size_of(subscribed), strict=False))
        self._subscriber = msgq.sub_sock(subscribed, timeout=2, **size)

    def send(self, service: str, stamp: int, content: Mapping[str, Any] | list[Any]) -> None:
        """Send a message with a stamp [ns], without the fields that this openpilot does not have.

        Raises:
            SourceError: Another process has taken the service.
        """
        name = self._names[service]
        if isinstance(content, Mapping):
            if name not in self._fields:
                self._fields[name] = self._event.schema.fields[name].schema.fields
            content = {field: value for field, value in content.items() if field in self._fields[name]}
        message = self._event.new_message(logMonoTime=stamp, valid=True, **{name: content})
        try:
            self._publishers[service].send(message.to_bytes())
        except self._is_taken as error:
            raise SourceError(
                f"another process publishes {name}; end it: there may be one camera daemon and one bridge"
            ) from error

    def receive(self) -> tuple[int, dict[str, Any]] | None:
        """Return stamp [ns] and content of the oldest message; None if none comes within 2 ms.

        Raises:
            SourceError: It is no message of the service.
        """
        content, service = self._subscriber.receive(), self._subscribed
        if content is None:
            return None
        try:
            with self._event.from_bytes(content) as event:
                return int(event.logMonoTime), getattr(event, service).to_dict()
        except (self._is_wrong, ValueError) as error:  # the second, where it does not end with a word
            reason = str(error).partition("\n")[0]
            raise SourceError(
                f"{len(content)} bytes on {service} are no message of it ({reason}); compare the schemas of both sides"
            ) from error

    def close(self) -> None:
        """Let go of the queues."""
        self._publishers.clear()
        self._subscriber = None
