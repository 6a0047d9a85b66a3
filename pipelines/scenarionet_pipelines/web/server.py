"""The web server of ``scenarionet browse``; it binds its port before printing the address."""

from __future__ import annotations

import socket
import threading
from contextlib import suppress

from scenarionet_data import Lake
from scenarionet_data.errors import BadParameter, needing
from scenarionet_pipelines.web.app import make_app
from scenarionet_pipelines.web.question_workers import Limits, QuestionWorkers

DEFAULT_PORT = 8642
"""Used if it is free, so that the address can be bookmarked."""

with needing("browsing needs a web server", "web"):
    import uvicorn


class Server:
    """Web server for one lake.

    Args:
        lake: The lake to show.
        host: Address to listen on; ``127.0.0.1`` accepts connections from this machine only.
        port: Port to listen on, 0 for any free one; None for the default port, or a free one if that is taken.
        is_writable: Whether the page may save databases.
        limits: Limits of each question that the page asks.

    Raises:
        BadParameter: The address or port is not available.

    Example:
        with Server(Lake("lake")) as server:
            print(server.address)
            server.run()
    """

    def __init__(
        self,
        lake: Lake,
        host: str = "127.0.0.1",
        port: int | None = None,
        *,
        is_writable: bool = False,
        limits: Limits | None = None,
    ) -> None:
        self._socket = _listen(host, port)
        self._workers = QuestionWorkers(lake, limits or Limits())
        app = make_app(lake, self._workers, is_writable=is_writable, names=frozenset({host, socket.gethostname()}))
        self._server = uvicorn.Server(
            uvicorn.Config(
                app, log_level="warning", access_log=False, server_header=False, lifespan="off", ws="none",
                timeout_graceful_shutdown=2,
            )
        )  # fmt: skip
        shown = f"[{host}]" if ":" in host else host
        self.address = f"http://{shown}:{self._socket.getsockname()[1]}/"

    def __enter__(self) -> Server:
        return self

    def __exit__(self, *_: object) -> None:
        self._workers.close()
        self._socket.close()

    def run(self) -> None:
        """Serve requests until Ctrl-C or :meth:`stop`."""
        serving = threading.Thread(target=self._server.run, kwargs={"sockets": [self._socket]}, daemon=True)
        serving.start()
        serving.join()  # not in this thread, where uvicorn would make Ctrl-C wait for running requests

    def stop(self) -> None:
        """Make :meth:`run` return, from another thread."""
        self._server.should_exit = True


def _listen(host: str, port: int | None) -> socket.socket:
    """Return a socket that listens on a port, on the default one, or on any."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    if port is None:
        with suppress(OSError):
            return socket.create_server((host, DEFAULT_PORT), family=family, backlog=128)
    try:
        return socket.create_server((host, port or 0), family=family, backlog=128)
    except OSError as error:
        raise BadParameter(f"cannot listen on {host}:{port or 0}: {error.strerror}; choose another port") from error
