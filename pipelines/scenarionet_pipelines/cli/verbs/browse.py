"""``scenarionet browse``: a lake in the browser."""

from __future__ import annotations

import click

from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.output import print_json
from scenarionet_pipelines.cli.parameters import json_option, lake_argument, snapshot_option

_LOOPBACK = ("127.0.0.1", "localhost", "::1")


@verb(
    "browse",
    "scenarionet browse lake",
    "scenarionet browse lake --open --write",
    "scenarionet browse lake --port 9000 --snapshot 3",
)
@lake_argument
@click.option("--host", default="127.0.0.1", show_default=True, help="Address to listen at.")
@click.option("--port", type=click.IntRange(0, 65535), help="Port; 8642, or a free one, unless given. 0: a free one.")
@click.option("--write", is_flag=True, help="Let the page save filters as databases.")
@click.option("--open", "is_opened", is_flag=True, help="Open it in the browser.")
@snapshot_option
@json_option
def command(
    lake: str, host: str, port: int | None, write: bool, is_opened: bool, snapshot: int | None, as_json: bool
) -> None:
    """Look at a lake in the browser: filter, sort and page through it, and play its scenarios.

    Serves a page at http://127.0.0.1:8642/ until Ctrl-C. Only this machine reaches it unless --host says otherwise,
    nothing is sent or loaded from elsewhere, and the lake is only read unless --write is given. Needs the extra
    `web`. With --json, the address is printed as one JSON object as soon as the page is served.
    """
    from scenarionet_data import Lake
    from scenarionet_pipelines.web.server import Server

    opened = Lake(lake, snapshot)
    with Server(opened, host, port, is_writable=write) as server:
        if as_json:
            print_json({"address": server.address, "lake": str(opened.root), "is_writable": write})
        else:
            click.echo(f"{opened.root} at {server.address} (Ctrl-C ends)")
        if host not in _LOOPBACK:
            what = "read the lake and save databases" if write else "read the lake"
            click.echo(f"warning: whoever reaches {host} can {what}; there is no password", err=True)
        if is_opened:
            click.launch(server.address)
        try:
            server.run()
        except KeyboardInterrupt:
            click.echo("ended", err=True)
