"""Converters and their options, as typed on the command line."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields
from typing import Any, get_type_hints

from scenarionet_data.converters.base import Converter
from scenarionet_data.ingest.options import Options
from scenarionet_data.scenario.settings import default_of, parse_texts, type_text
from scenarionet_pipelines.cli.parameters import look_in_current_folder, pairs


@dataclass(frozen=True)
class ConverterOption:
    """An option of a converter.

    Attributes:
        name: Name of the field in the converter's ``Options``.
        type: Type of the field.
        default: Default value.
        doc: Description.
    """

    name: str
    type: Any
    default: Any
    doc: str

    @property
    def type_text(self) -> str:
        """The type as written in source code."""
        return type_text(self.type)


def find(name: str) -> Converter[Any]:
    """Return the converter of that name; ``module:Class`` may be a module in the current folder.

    Raises:
        SourceNotFound: No converter has that name.
    """
    from scenarionet_data import converters

    look_in_current_folder(name)
    return converters.get(name)


def options(kind: type[Any]) -> list[ConverterOption]:
    """Return the fields of a dataclass, in order: the options of a converter, or the writer of a format."""
    hints, found = get_type_hints(kind), []
    for field in fields(kind):
        doc = field.metadata.get("doc", "")
        found.append(ConverterOption(field.name, hints[field.name], default_of(field), doc))
    return found


def parse_options(converter: Converter[Any], words: Iterable[str]) -> Options:
    """Parse ``key=value`` words into a converter's options.

    Raises:
        BadParameter: An option is unknown or a value does not match its type; the message lists the valid ones.
    """
    given = pairs(words, "-p")
    for key in given:
        converter.Options.refuse_removed(key)
    return converter.Options(**parse_texts(converter.Options, converter.name, given))
