"""A driver in another process as a planner, by name: ``driver:5555``, ``driver:HOST:PORT``, ``driver:/PATH``.

Or in a container that is started for it, ``docker:IMAGE``: see ``containers``.
"""

from __future__ import annotations

import atexit
import socket
import time
from functools import cache
from typing import Any

from scenarionet_data.errors import BadParameter, SourceError
from scenarionet_sim.bridges.driver.containers import Container, is_container
from scenarionet_sim.bridges.driver.wire import fill, message, read, receive, send
from scenarionet_sim.bridges.link import AGAIN, GONE, LIMIT
from scenarionet_sim.planners.base import Action, Planner, Trajectory
from scenarionet_sim.planners.view import View

PREFIX = "driver:"


def is_driver(policy: str) -> bool:
    """Return whether the name of a policy is that of a driver in another process."""
    return policy.startswith(PREFIX) or is_container(policy)


class DriverPlanner(Planner):
    """Asks the driver of an address; all vehicles of a timestep in one message.

    Args:
        policy: Its name.

    Raises:
        BadParameter: It has no port and no path.
        MissingDependency: protobuf is not installed.
    """

    def __init__(self, policy: str) -> None:
        self._connection, self._episode = connection_to(policy), 0

    def expect(self, view: View) -> None:
        """Add the vehicle to the next message."""
        is_first = not self._episode
        self._episode = self._episode or self._connection.begin()
        self._connection.add(view, self._episode, is_first=is_first)

    def act(self, view: View) -> Action | Trajectory:
        """Return what the driver tells this vehicle to do."""
        del view
        return read(self._connection.command(self._episode))


class DriverConnection:
    """The connection of this process to a driver.

    One that fails is closed, and opened again where the next episode begins: within ``limit``, but soon given up while
    the driver has not answered since.

    Args:
        address: Path of a socket, host and port, or what starts a container that binds one.
        limit: Longest wait for an answer [s].
    """

    def __init__(self, address: str | tuple[str, int] | Container, limit: float) -> None:
        self.address, self.limit = address, limit
        self._socket: socket.socket | None = None
        self._episodes = 0
        self._is_gone = False
        self._asked = message("Moments")()
        self._told: dict[int, Any] = {}

    def begin(self) -> int:
        """Return the number of a new episode."""
        self._episodes += 1
        return self._episodes

    def add(self, view: View, episode: int, *, is_first: bool) -> None:
        """Add a moment to the next message."""
        fill(self._asked.moments.add(), view, episode, is_first=is_first)

    def command(self, episode: int) -> Any:
        """Return the command for an episode; the first of a timestep to ask sends the message of all.

        Raises:
            SourceError: The driver cannot be reached, or does not answer as it should.
        """
        if self._asked.moments:
            asked, self._asked, self._told = self._asked, message("Moments")(), {}
            try:
                self._told = self._ask(asked)
                self._is_gone = False
            except (OSError, SourceError) as error:
                self.close()
                self._is_gone = True
                what = "did not answer in time" if isinstance(error, TimeoutError) else str(error)
                raise SourceError(f"driver at {self.address}: {what}; is it running?") from error
        if episode not in self._told:
            raise SourceError(f"driver at {self.address}: no command for an episode of the moment; is it running?")
        return self._told[episode]

    def close(self) -> None:
        """Hang up."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def end(self) -> None:
        """Hang up, and end the container."""
        self.close()
        if isinstance(self.address, Container):
            self.address.close()

    def _ask(self, asked: Any) -> dict[int, Any]:
        begins = [moment.HasField("begin") for moment in asked.moments]
        if self._socket is None:
            if not all(begins):
                raise SourceError("it was lost within an episode")
            self._socket = self._open(GONE if self._is_gone else self.limit)
        send(self._socket, asked.SerializeToString())
        answer = message("Commands")()
        content = receive(self._socket)
        try:
            answer.ParseFromString(content)
        except Exception as error:  # DecodeError, whose place differs between versions
            raise SourceError(f"{len(content)} bytes of it are no Commands") from error
        return {command.episode: command for command in answer.commands}

    def _open(self, limit: float) -> socket.socket:
        """Connect; a driver may start after the simulator."""
        address = self.address.socket() if isinstance(self.address, Container) else self.address
        end = time.monotonic() + limit
        while True:
            try:
                if isinstance(address, str):
                    opened = socket.socket(socket.AF_UNIX)
                    opened.connect(address)
                else:
                    opened = socket.create_connection(address, timeout=limit)
                    opened.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                opened.settimeout(self.limit)
                return opened
            except OSError:
                if time.monotonic() > end:
                    raise
                time.sleep(min(AGAIN, limit) / 5.0)


def address_of(policy: str) -> str | tuple[str, int]:
    """Return path, or host and port, of a policy; the host is this machine unless it says so.

    Raises:
        BadParameter: It has neither.

    Example:
        >>> address_of("driver:5555"), address_of("driver:10.0.0.5:5555"), address_of("driver:/tmp/mine.sock")
        (('127.0.0.1', 5555), ('10.0.0.5', 5555), '/tmp/mine.sock')
    """
    place = policy.removeprefix(PREFIX)
    host, _, port = place.rpartition(":")
    if place.startswith("/"):
        return place
    if not (port.isdecimal() and 0 < int(port) < 1 << 16):
        raise BadParameter(f"{policy}: expected driver:PORT, driver:HOST:PORT or driver:/PATH of a socket")
    return host or "127.0.0.1", int(port)


@cache
def connection_to(policy: str) -> DriverConnection:
    """Return the connection of this process to a driver; it stays open from scenario to scenario."""
    made = DriverConnection(Container(policy) if is_container(policy) else address_of(policy), LIMIT)
    atexit.register(made.end)
    return made
