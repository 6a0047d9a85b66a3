"""``scenarionet browse``: open a lake in the browser."""

from __future__ import annotations

import click

from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.interrupt import stop
from scenarionet_pipelines.cli.output import print_json
from scenarionet_pipelines.cli.parameters import json_option, lake_argument, seconds, snapshot_option

_LOOPBACK = ("127.0.0.1", "localhost", "::1")


@verb(
    "browse",
    "scenarionet browse lake",
    "scenarionet browse lake --open --write",
    "scenarionet browse lake --port 9000 --snapshot 3",
)
@lake_argument
@click.option("--host", default="127.0.0.1", show_default=True, help="Address to listen on.")
@click.option(
    "--port", type=click.IntRange(0, 65535), help="Port; 0 selects a free one. [default: 8642, or a free one if taken]"
)
@click.option("--write", is_flag=True, help="Allow the page to save filters as databases.")
@click.option("--open", "is_opened", is_flag=True, help="Open the page in the default browser.")
@click.option(
    "--timeout", default="10s", show_default=True, metavar="TIME", help="Stop filters that take longer (30s, 5min)."
)
@click.option(
    "--memory",
    type=click.FloatRange(0.1),
    default=1.0,
    show_default=True,
    metavar="GB",
    help="Stop filters that need more memory.",
)
@snapshot_option
@json_option
def command(
    lake: str,
    host: str,
    port: int | None,
    write: bool,
    is_opened: bool,
    timeout: str,
    memory: float,
    snapshot: int | None,
    as_json: bool,
) -> None:
    """Open a lake in the browser: filter and sort its scenarios, and play them.

    The page is served at http://127.0.0.1:8642/ until Ctrl-C. By default only this machine can connect and the lake
    is read-only; the page loads nothing from other hosts. Up to four filters run at the same time, each in a
    process of its own that is stopped at the limits of --timeout and --memory. With --json, the address is printed
    as one JSON object as soon as the page is available. Requires the extra `web`.
    """
    from scenarionet_data import Lake
    from scenarionet_pipelines.web.question_workers import Limits
    from scenarionet_pipelines.web.server import Server

    limits = Limits(seconds(timeout, "--timeout"), int(1e9 * memory))
    opened = Lake(lake, snapshot)
    with Server(opened, host, port, is_writable=write, limits=limits) as server:
        if as_json:
            print_json({"address": server.address, "lake": str(opened.root), "is_writable": write})
        else:
            click.echo(f"{opened.root} at {server.address} (stop with Ctrl-C)")
        if host not in _LOOPBACK:
            access = "read the lake and save databases" if write else "read the lake"
            click.echo(f"warning: anyone who can connect to {host} can {access}; there is no password", err=True)
        if is_opened:
            click.launch(server.address)
        try:
            server.run()
        except KeyboardInterrupt:
            stop("stopped")
