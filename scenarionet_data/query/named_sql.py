"""Named SQL files: a description, parameters with defaults, and one statement or condition.

-- Scenarios whose ego travels at least $min metres.
-- min = 10.0
ego_distance >= $min
"""

from __future__ import annotations

import difflib
import json
import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from numbers import Integral
from typing import Any, TypeAlias

from scenarionet_data.arrays.dtypes import is_number
from scenarionet_data.errors import BadParameter, QueryError, UnknownEvent, UnknownFilter, UnknownQuery, UnknownRelation
from scenarionet_data.schema.package_data import SQL


@dataclass(frozen=True)
class NamedSql:
    """The content of a file below ``sql/``.

    Attributes:
        name: Name of the file.
        doc: Description.
        defaults: Parameters and their defaults.
        text: The SQL.
    """

    name: str
    doc: str
    defaults: dict[str, Any]
    text: str

    def bind(self, parameters: Mapping[str, Any]) -> dict[str, Any]:
        """Return the values of all parameters: the defaults, updated with the given values.

        Args:
            parameters: Python values of the types of the defaults; whole numbers are accepted for floats.

        Raises:
            BadParameter: A parameter is unknown, or its value has another type.
        """
        if not isinstance(parameters, Mapping):
            raise BadParameter(f"{self.name}: parameters: wanted values by name, found {parameters!r}")
        bound = dict(self.defaults)
        for key, value in parameters.items():
            default = self._default(key)
            if isinstance(default, list):
                is_valid = not isinstance(value, str) and isinstance(value, Iterable)
                value = list(value) if is_valid else value
            elif isinstance(default, float):
                is_valid = is_number(value) and not math.isnan(value)
                value = float(value) if is_valid else value
            elif isinstance(default, int) and not isinstance(default, bool):
                is_valid = isinstance(value, Integral) and not isinstance(value, bool)
                value = int(value) if is_valid else value
            else:
                is_valid = isinstance(value, type(default))
            if not is_valid:
                raise BadParameter(f"{self.name}: {key} wants {type(default).__name__}, found {value!r}")
            bound[key] = value
        return bound

    def parse(self, texts: Mapping[str, str]) -> dict[str, Any]:
        """Return the values of the given parameters from text, as on the command line; lists are split at blanks.

        Raises:
            BadParameter: A parameter is unknown, or its text has another type.
        """
        values: dict[str, Any] = {}
        for key, text in texts.items():
            kind = type(self._default(key))
            try:
                if kind is list:
                    values[key] = text.split()
                else:
                    values[key] = json.loads(text.lower()) is True if kind is bool else kind(text)
            except ValueError as error:
                raise BadParameter(f"{self.name}: {key} wants {kind.__name__}, found {text!r}") from error
        return values

    def _default(self, key: str) -> Any:
        if key not in self.defaults:
            raise BadParameter(f"{self.name} has no parameter {key!r}; it has {', '.join(self.defaults) or 'none'}")
        return self.defaults[key]


Conditions: TypeAlias = str | Iterable[str] | Mapping[str, Mapping[str, Any]]
"""Filters or events: one or several ``name:key=value,key=value``, or parameters as Python values by name."""


@dataclass(frozen=True)
class Folder:
    """A folder of such files.

    Attributes:
        name: Name of the folder below ``sql/``.
        unknown: Error raised for a file that does not exist.
    """

    name: str
    unknown: type[QueryError]

    def names(self) -> list[str]:
        """Return the names of the files, sorted."""
        return sorted(path.stem for path in (SQL / self.name).glob("*.sql"))

    def load(self, name: str) -> NamedSql:
        """Load a file by name.

        Raises:
            QueryError: As ``unknown``: no such file; the message suggests similar names.
        """
        if name not in self.names():
            near = difflib.get_close_matches(str(name), self.names(), n=3) or self.names()
            raise self.unknown(f"nothing called {name!r} in sql/{self.name}; did you mean {', '.join(near)}?")
        lines = (SQL / self.name / f"{name}.sql").read_text("utf-8").splitlines()
        start = next((number for number, line in enumerate(lines) if not line.startswith("--")), len(lines))
        comments = [line.removeprefix("--").strip() for line in lines[:start]]
        pairs = [re.fullmatch(r"(\w+) = (.+)", comment) for comment in comments]
        defaults = {pair.group(1): json.loads(pair.group(2)) for pair in pairs if pair}
        doc = " ".join(comment for comment, pair in zip(comments, pairs, strict=True) if not pair)
        return NamedSql(name, doc, defaults, "\n".join(line for line in lines[start:] if line))

    def parse(self, text: str) -> tuple[NamedSql, dict[str, Any]]:
        """Return a file and the values of its parameters from ``name:key=value,key=value``.

        Raises:
            QueryError: As ``unknown``: no such file.
            BadParameter: A parameter is unknown, or its text has another type.

        Example:
            >>> FILTERS.parse("ego_distance:min=25")[1]["min"]
            25.0
        """
        name, _, rest = text.partition(":")
        found = self.load(name)
        pairs = (pair.partition("=") for pair in filter(None, rest.split(",")))
        return found, found.bind(found.parse({key: value for key, _, value in pairs}))

    def resolve(self, given: Conditions) -> list[tuple[NamedSql, dict[str, Any]]]:
        """Return files and the values of their parameters.

        Args:
            given: ``"ego_distance"``, ``["ego_distance:min=25", ...]`` or ``{"ego_distance": {"min": 25}}``.

        Raises:
            QueryError: As ``unknown``: no such file.
            BadParameter: A parameter is unknown, or its value has another type.
        """
        if isinstance(given, str):
            return [self.parse(given)]
        if isinstance(given, Mapping):
            found = [(self.load(name), values) for name, values in given.items()]
            return [(file, file.bind(values)) for file, values in found]
        if not isinstance(given, Iterable) or not all(isinstance(each, str) for each in given):
            raise BadParameter(f"{self.name}: wanted names, or parameters by name, found {given!r}")
        return list(map(self.parse, given))


FILTERS = Folder("filters", UnknownFilter)
"""Conditions over the view ``metadata``."""
EVENTS = Folder("events", UnknownEvent)
"""SELECTs of events inside scenarios, see :mod:`scenarionet_data.operations.events`."""
RELATIONS = Folder("relations", UnknownRelation)
"""SELECTs of the steps at which something holds, see :mod:`scenarionet_data.operations.moments`."""
DISTURBANCES = Folder("disturbances", UnknownEvent)
"""SELECTs of what disturbs an ego, with parameters, see :mod:`scenarionet_data.catalogue`."""
CATALOGUE = Folder("catalogue", UnknownQuery)
"""SELECTs of the tables and figures of a catalogue."""
ANALYTICS = Folder("analytics", UnknownQuery)
"""SELECTs over the views of a lake."""
OVERLAPS = Folder("overlaps", UnknownQuery)
"""SELECTs of a key for every scenario: two databases overlap where they share a key."""
CHECKS = Folder("checks", UnknownQuery)
"""SELECTs of violations of a rule, see :mod:`scenarionet_data.quality`."""
