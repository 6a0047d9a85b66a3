"""SQL in files of its own: a description, parameters with defaults, and one statement or condition.

-- Scenarios whose ego travels at least $min metres.
-- min = 10.0
ego_distance >= $min
"""

from __future__ import annotations

import difflib
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from scenarionet_data.errors import BadParameter, QueryError, UnknownEvent, UnknownFilter, UnknownQuery
from scenarionet_data.schema.package_data import SQL


@dataclass(frozen=True)
class NamedSql:
    """The content of a file below ``sql/``.

    Attributes:
        name: Its file's name.
        doc: What it is about.
        defaults: Parameters and their defaults.
        text: The SQL.
    """

    name: str
    doc: str
    defaults: dict[str, Any]
    text: str

    def bind(self, words: Mapping[str, str]) -> dict[str, Any]:
        """Values of all parameters: the defaults, and in their place what was typed.

        Raises:
            BadParameter: There is no such parameter, or it wants a value of another type.
        """
        bound = dict(self.defaults)
        for key, word in words.items():
            if key not in bound:
                raise BadParameter(f"{self.name} has no parameter {key!r}; it has {', '.join(bound) or 'none'}")
            bound[key] = self._convert(key, word)
        return bound

    def _convert(self, key: str, word: str) -> Any:
        """A typed word as a value of the default's type."""
        kind = type(self.defaults[key])
        if kind is list:
            return word.split()
        try:
            return json.loads(word.lower()) is True if kind is bool else kind(word)
        except ValueError as error:
            raise BadParameter(f"{self.name}: {key} wants {kind.__name__}, found {word!r}") from error


@dataclass(frozen=True)
class Folder:
    """A folder of such files.

    Attributes:
        name: Its name below ``sql/``.
        unknown: What is raised for a file that is not there.
    """

    name: str
    unknown: type[QueryError]

    def names(self) -> list[str]:
        """Files there are, sorted."""
        return sorted(path.stem for path in (SQL / self.name).glob("*.sql"))

    def load(self, name: str) -> NamedSql:
        """A file by name.

        Raises:
            QueryError: As ``unknown``: there is none; the message lists the nearest names.
        """
        if name not in self.names():
            near = difflib.get_close_matches(name, self.names(), n=3) or self.names()
            raise self.unknown(f"nothing called {name!r} in sql/{self.name}; did you mean {', '.join(near)}?")
        return _read(name, (SQL / self.name / f"{name}.sql").read_text("utf-8").splitlines())

    def parse(self, text: str) -> tuple[NamedSql, dict[str, Any]]:
        """A file and the values of its parameters from the command line's ``name:key=value,key=value``.

        Raises:
            QueryError: As ``unknown``: there is no such file.
            BadParameter: No such parameter, or no such value.

        Example:
            >>> FILTERS.parse("ego_distance:min=25")[1]["min"]
            25.0
        """
        name, _, rest = text.partition(":")
        found = self.load(name)
        pairs = (pair.partition("=") for pair in filter(None, rest.split(",")))
        return found, found.bind({key: value for key, _, value in pairs})


FILTERS = Folder("filters", UnknownFilter)
"""Conditions over the view ``metadata``."""
EVENTS = Folder("events", UnknownEvent)
"""SELECTs of what happens inside scenarios, see ``mining``."""
QUESTIONS = Folder("analytics", UnknownQuery)
"""SELECTs over a lake's views."""
OVERLAPS = Folder("overlaps", UnknownQuery)
"""SELECTs of a key for every scenario: what two databases share when both have a key."""
CHECKS = Folder("checks", UnknownQuery)
"""SELECTs of what breaks a rule, see ``checks``."""


def _read(name: str, lines: list[str]) -> NamedSql:
    start = next((number for number, line in enumerate(lines) if not line.startswith("--")), len(lines))
    comments = [line.removeprefix("--").strip() for line in lines[:start]]
    pairs = [re.fullmatch(r"(\w+) = (.+)", comment) for comment in comments]
    defaults = {pair.group(1): json.loads(pair.group(2)) for pair in pairs if pair}
    doc = " ".join(comment for comment, pair in zip(comments, pairs, strict=True) if not pair)
    return NamedSql(name, doc, defaults, "\n".join(line for line in lines[start:] if line))
