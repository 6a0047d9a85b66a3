"""Lists of named SQL: events, filters and queries, with their parameters as they are typed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from scenarionet_pipelines.cli.output import print_json

if TYPE_CHECKING:
    from scenarionet_data.query.named_sql import Folder


def show_named(folder: Folder, noun: str, as_json: bool) -> None:
    """Print each named SQL of a folder with its parameters and what it is.

    Args:
        folder: The folder.
        noun: What they are, for example ``"events"``.
        as_json: Print one JSON object.
    """
    found = [folder.load(name) for name in folder.names()]
    if as_json:
        print_json({noun: [{"name": each.name, "doc": each.doc, "parameters": each.defaults} for each in found]})
        return
    for each in found:
        parameters = ",".join(f"{key}={as_typed(value)}" for key, value in each.defaults.items())
        click.echo(f"{each.name}:{parameters}" if parameters else each.name)
        click.echo(click.wrap_text(each.doc, 110, "    ", "    "))


def as_typed(value: Any) -> str:
    """Return a default as it would be typed."""
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:g}" if isinstance(value, (int, float)) else " ".join(value) if isinstance(value, list) else value
