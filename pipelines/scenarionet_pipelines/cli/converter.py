"""Converters and their options, as typed on the command line."""

from __future__ import annotations

import types
from collections.abc import Iterable
from dataclasses import MISSING, dataclass, fields
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

from scenarionet_data.converters.base import Converter
from scenarionet_data.errors import BadParameter
from scenarionet_data.ingest.options import Options
from scenarionet_pipelines.cli.parameters import look_in_current_folder, pairs

_WORDS = {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}


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
        return self.type.__name__ if isinstance(self.type, type) else str(self.type).replace("typing.", "")


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
        default = field.default if field.default_factory is MISSING else field.default_factory()
        found.append(ConverterOption(field.name, hints[field.name], default, field.metadata.get("doc", "")))
    return found


def parse_options(converter: Converter[Any], words: Iterable[str]) -> Options:
    """Parse ``key=value`` words into a converter's options.

    Raises:
        BadParameter: An option is unknown or a value does not match its type; the message lists the valid ones.
    """
    words = tuple(words)
    for key in pairs(words, "-p"):
        converter.Options.refuse_removed(key)
    return converter.Options(**parse_fields(converter.Options, converter.name, words))


def parse_fields(kind: type[Any], name: str, words: Iterable[str]) -> dict[str, Any]:
    """Parse ``key=value`` words into values for the fields of a dataclass.

    Args:
        kind: The dataclass: the options of a converter, or the writer of a format.
        name: What has these fields, for error messages.
        words: As typed after ``-p``.

    Raises:
        BadParameter: A field is unknown or a value does not match its type; the message lists the valid ones.
    """
    known, given = {each.name: each for each in options(kind)}, {}
    for key, word in pairs(words, "-p").items():
        if key not in known:
            raise BadParameter(f"{name} has no option {key!r}; it has {', '.join(known) or 'none'}")
        try:
            given[key] = _convert(known[key].type, word)
        except (ValueError, KeyError) as error:
            wanted = f"{known[key].type_text}, for example {known[key].default!r}"
            raise BadParameter(f"{name}: option {key} wants {wanted}; found {word!r}") from error
    return given


def _convert(wanted: Any, word: str) -> Any:
    """Convert a word to the wanted type; raises ValueError or KeyError where that is impossible."""
    origin, inner = get_origin(wanted), get_args(wanted)
    if origin in (Union, types.UnionType):
        if type(None) in inner and word.lower() == "none":
            return None
        return _convert(next(kind for kind in inner if kind is not type(None)), word)
    if origin is Literal:
        return next(value for value in inner if str(value) == word) if word in map(str, inner) else int("?")
    if origin is tuple:
        words = word.split(",") if word else []
        kinds = [inner[0]] * len(words) if inner[-1] is Ellipsis else inner
        return tuple(_convert(kind, each) for kind, each in zip(kinds, words, strict=True))
    if wanted is bool:
        return _WORDS[word.lower()]
    return wanted(word)
