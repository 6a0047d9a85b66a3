"""Named filters: one condition a file in ``sql/filters``, with parameters, their defaults and a description.

-- Scenarios whose ego travels at least $min metres.
-- min = 10.0
ego_distance >= $min
"""

from __future__ import annotations

import difflib
import json
import re
from dataclasses import dataclass
from typing import Any

from scenarionet_data.errors import BadParameter, UnknownFilter
from scenarionet_data.resources import SQL


@dataclass(frozen=True)
class Filter:
    """A named condition over the view ``metadata``.

    Attributes:
        name: Its file's name.
        doc: What it keeps.
        defaults: Parameters and their defaults.
        condition: The SQL.
    """

    name: str
    doc: str
    defaults: dict[str, Any]
    condition: str


def names() -> list[str]:
    """Filters there are, sorted."""
    return sorted(path.stem for path in (SQL / "filters").glob("*.sql"))


def load(name: str) -> Filter:
    """A filter by name.

    Raises:
        UnknownFilter: The message lists the nearest names.
    """
    if name not in names():
        near = difflib.get_close_matches(name, names(), n=3) or names()
        raise UnknownFilter(f"no filter {name!r}; did you mean {', '.join(near)}?")
    lines = (SQL / "filters" / f"{name}.sql").read_text("utf-8").splitlines()
    comments = [line.removeprefix("--").strip() for line in lines if line.startswith("--")]
    pairs = [re.fullmatch(r"(\w+) = (.+)", comment) for comment in comments]
    defaults = {pair.group(1): json.loads(pair.group(2)) for pair in pairs if pair}
    doc = " ".join(comment for comment, pair in zip(comments, pairs, strict=True) if not pair)
    condition = "\n".join(line for line in lines if line and not line.startswith("--"))
    return Filter(name, doc, defaults, condition)


def parse(text: str) -> tuple[Filter, dict[str, Any]]:
    """A filter with its parameters from the command line's ``name:key=value,key=value``.

    Raises:
        UnknownFilter: No such filter.
        BadParameter: No such parameter, or no such value.

    Example:
        >>> parse("ego_distance:min=25")[1]
        {'min': 25.0}
    """
    name, _, rest = text.partition(":")
    found = load(name)
    parameters = dict(found.defaults)
    for pair in filter(None, rest.split(",")):
        key, _, value = pair.partition("=")
        if key not in parameters:
            raise BadParameter(f"filter {name} has no parameter {key!r}; it has {', '.join(parameters) or 'none'}")
        kind = type(found.defaults[key])
        try:
            parameters[key] = kind(value)
        except ValueError as error:
            raise BadParameter(f"filter {name}: {key} wants {kind.__name__}, found {value!r}") from error
    return found, parameters
