"""``scenarionet converters``: what can be converted, and what each converter can be told."""

from __future__ import annotations

from typing import Any

import click

from scenarionet_pipelines.cli.group import one_line, verb
from scenarionet_pipelines.cli.output import print_json, print_table
from scenarionet_pipelines.cli.parameters import json_option

_FACTS = ("raw", "release", "licence", "version")


@verb("converters", "scenarionet converters", "scenarionet converters pg", "scenarionet converters --json")
@click.argument("name", required=False)
@json_option
def command(name: str | None, as_json: bool) -> None:
    """List the converters, or explain one with its options."""
    if name:
        _explain(name, as_json)
    else:
        _list(as_json)


def _list(as_json: bool) -> None:
    from scenarionet_data import converters

    found = [_describe(name) for name in converters.names()]
    if as_json:
        print_json({"converters": found})
        return
    for facts in found:
        click.echo(click.style(facts["name"], bold=True))
        print_table([("", key, facts[key]) for key in ("error", *_FACTS) if key in facts])
    click.echo("Options of one: scenarionet converters NAME")


def _describe(name: str) -> dict[str, Any]:
    """A converter's facts, or why it cannot be loaded."""
    from scenarionet_pipelines.cli import converter

    try:
        found = converter.find(name)
    except Exception as error:  # an installed package of anybody's may fail in any way; list it with the rest
        return {"name": name, "error": one_line(error)}
    return {"name": name} | {fact: getattr(found, fact) for fact in _FACTS}


def _explain(name: str, as_json: bool) -> None:
    from scenarionet_pipelines.cli import converter

    found = converter.find(name)
    options = [
        {"name": option.name, "type": option.type_text, "default": option.default, "doc": option.doc}
        for option in converter.options(found)
    ]
    facts = {"name": name} | {fact: getattr(found, fact) for fact in _FACTS}
    facts["where"] = ["file", "name", *found.properties]
    if as_json:
        print_json(facts | {"options": options})
        return
    print_table((facts | {"where": ", ".join(facts["where"])}).items())
    click.echo()
    if options:
        print_table([option.values() for option in options], ("option", "type", "default", ""))
    click.echo(f"Use: scenarionet convert {name} RAW LAKE" + (" -O OPTION=VALUE" if options else ""))
