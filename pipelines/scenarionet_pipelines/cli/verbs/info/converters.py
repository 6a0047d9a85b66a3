"""``scenarionet info converters``: list converters and their options."""

from __future__ import annotations

from typing import Any

import click

from scenarionet_pipelines.cli.output import table
from scenarionet_pipelines.cli.verb import Verb, argument
from scenarionet_pipelines.messages import one_line

_PROPERTIES = ("raw", "release", "licence", "version")


class ConvertersVerb(Verb):
    """List the converters, or describe one with its options."""

    examples = (
        "scenarionet info converters",
        "scenarionet info converters pg",
        "scenarionet info converters --json",
    )
    name: str | None = argument()

    def run(self) -> None:
        if self.name:
            self.explain(self.name)
            return
        from scenarionet_data import converters

        found = [describe(name) for name in converters.names()]
        lines = []
        for properties in found:
            lines.append(click.style(properties["name"], bold=True))
            lines += table([("", key, properties[key]) for key in ("error", *_PROPERTIES) if key in properties])
        self.say({"converters": found}, [*lines, "Options of a converter: scenarionet info converters NAME"])

    def explain(self, name: str) -> None:
        """Print what a converter expects, and its options."""
        from scenarionet_data.converters.splits import ACCEPTED
        from scenarionet_pipelines.cli import converter

        found = converter.find(name)
        options = [
            {"name": option.name, "type": option.type_text, "default": option.default, "doc": option.doc}
            for option in converter.options(found.Options)
        ]
        properties = {"name": name} | {key: getattr(found, key) for key in _PROPERTIES}
        properties["split"] = ACCEPTED.get(name, ("any label",))
        properties["where"] = ["file", "name", *found.properties]
        lines = table((properties | {key: ", ".join(properties[key]) for key in ("split", "where")}).items())
        head = ("option", "type", "default", "")
        lines += ["", *(table([option.values() for option in options], head) if options else [])]
        lines.append(f"Use: scenarionet convert {name} RAW LAKE" + (" -p OPTION=VALUE" if options else ""))
        self.say(properties | {"options": options}, lines)


def describe(name: str) -> dict[str, Any]:
    """Return the properties of a converter, or the error that prevents loading it."""
    from scenarionet_pipelines.cli import converter

    try:
        found = converter.find(name)
    except Exception as error:  # a third-party plug-in can fail in any way; list it with its error
        return {"name": name, "error": one_line(error)}
    return {"name": name} | {key: getattr(found, key) for key in _PROPERTIES}
