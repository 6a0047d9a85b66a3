"""Forms of the fields of many similar dictionaries, such as a pickle's tracks, column by column.

A form is text that says how a pickle writes one field. A column has one form per dictionary, None where the field is
absent. Most columns have one form or few, in long runs, and are stored as such.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import lru_cache
from itertools import groupby
from typing import Any

from scenarionet_data.converters.scenarionet.values import from_plain, to_plain

OWN = "own"
"""Form of a field that is stored with its track or map feature, because it is large or differs between them."""

_LITERAL = "="
_SIMPLE = (str, int, bool, type(None))
_ENCODER = json.JSONEncoder(separators=(",", ":"), ensure_ascii=False, allow_nan=False)


def literal(value: Any) -> str:
    """Form of a field that has this value."""
    return (
        _simple_literal(type(value).__name__, value)
        if type(value) in _SIMPLE
        else _LITERAL + _ENCODER.encode(to_plain(value))
    )


@lru_cache(maxsize=1024)
def _simple_literal(_: str, value: Any) -> str:
    """Most fields have one of few values; the type is an argument because 1, 1.0 and True are equal."""
    return _LITERAL + _ENCODER.encode(value)


def is_literal(form: str) -> bool:
    """Whether a form is a value itself."""
    return form.startswith(_LITERAL)


def value_of(form: str) -> Any:
    """Return a new copy of the value that a literal form has."""
    return from_plain(json.loads(form[len(_LITERAL) :]))


def pack(forms: Sequence[str | None]) -> Any:
    """Return a column for JSON: its only form, or the distinct forms and the runs [count, form, count, form, ...].

    Example:
        >>> pack(["a", "a", None, "b"])
        {'forms': ['a', 'b'], 'runs': [2, 0, 1, -1, 1, 1]}
    """
    distinct = [form for form in dict.fromkeys(forms) if form is not None]
    if len(distinct) == 1 and None not in forms:
        return distinct[0]
    numbers: dict[str | None, int] = {None: -1, **{form: number for number, form in enumerate(distinct)}}
    runs: list[int] = []
    for form, run in groupby(forms):
        runs += len(list(run)), numbers[form]
    return {"forms": distinct, "runs": runs}


def unpack(column: Any, count: int) -> list[str | None]:
    """Return the ``count`` forms of a column that :func:`pack` returned."""
    if isinstance(column, str):
        return [column] * count
    forms, runs = [*column["forms"], None], iter(column["runs"])
    return [forms[number] for length in runs for number in [next(runs)] * length]
