"""``scenarionet browse``: open a lake in the browser."""

from __future__ import annotations

import click

from scenarionet_pipelines.cli.interrupt import stop
from scenarionet_pipelines.cli.parameters import FiniteRange, seconds
from scenarionet_pipelines.cli.verb import SNAPSHOT, LakeVerb, option

_LOOPBACK = ("127.0.0.1", "localhost", "::1")


class BrowseVerb(LakeVerb):
    """Open a lake in the browser: filter and sort its scenarios, and play them.

    The page is served at http://127.0.0.1:8642/ until Ctrl-C. By default only this machine can connect and the lake
    is read-only; the page loads nothing from other hosts. Up to four filters run at the same time, each in a
    process of its own that is stopped at the limits of --timeout and --memory. With --json, the address is printed
    as one JSON object as soon as the page is available. Requires the extra `web`.
    """

    examples = (
        "scenarionet browse lake",
        "scenarionet browse lake --open --write",
        "scenarionet browse lake --port 9000 --snapshot 3",
    )
    host: str = option("Address to listen on.", default="127.0.0.1")
    port: int | None = option(
        "Port; 0 selects a free one. [default: 8642, or a free one if taken]", type=click.IntRange(0, 65535)
    )
    write: bool = option("Allow the page to save filters as databases.")
    is_opened: bool = option("Open the page in the default browser.", "--open")
    timeout: str = option("Stop filters that take longer (30s, 5min).", default="10s", metavar="TIME")
    memory: float = option("Stop filters that need more memory.", type=FiniteRange(0.1), default=1.0, metavar="GB")
    snapshot: int | None = SNAPSHOT

    def run(self) -> None:
        from scenarionet_pipelines.web.question_workers import Limits
        from scenarionet_pipelines.web.server import Server

        limits = Limits(seconds(self.timeout, "--timeout"), int(1e9 * self.memory))
        opened = self.open()
        with Server(opened, self.host, self.port, is_writable=self.write, limits=limits) as server:
            content = {"address": server.address, "lake": str(opened.root), "is_writable": self.write}
            self.say(content, f"{opened.root} at {server.address} (stop with Ctrl-C)")
            if self.host not in _LOOPBACK:
                access = "read the lake and save databases" if self.write else "read the lake"
                click.echo(
                    f"warning: anyone who can connect to {self.host} can {access}; there is no password", err=True
                )
            if self.is_opened:
                click.launch(server.address)
            try:
                server.run()
            except KeyboardInterrupt:
                stop("stopped")
