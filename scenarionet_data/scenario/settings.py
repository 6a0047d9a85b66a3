"""What settings that are dataclasses have in common."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import MISSING, Field, fields, is_dataclass
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import numpy as np

from scenarionet_data.arrays.dtypes import is_count, is_number
from scenarionet_data.errors import BadParameter
from scenarionet_data.scenario.vocabulary import MapFeatureType, ObjectType


def _all(kind: type) -> Callable[[Any], bool]:
    return lambda value: isinstance(value, tuple | list) and all(isinstance(each, kind) for each in value)


Positive = Annotated[float, "above 0"]
NonNegative = Annotated[float, "0 or more"]
Share = Annotated[float, "from 0 to 1"]
Count = Annotated[int, "1 or more"]
Natural = Annotated[int, "0 or more"]
"""Types of settings within bounds, which :func:`check_settings` knows by these names; a subclass that gives a field
another default repeats its type."""


def _is_finite(value: Any) -> bool:
    return is_number(value) and math.isfinite(value)


_KINDS: dict[str, tuple[Callable[[Any], bool], str]] = {
    "float": (_is_finite, "a finite number"),
    "Positive": (lambda value: _is_finite(value) and value > 0, "a number above 0"),
    "NonNegative": (lambda value: _is_finite(value) and value >= 0, "a number of 0 or more"),
    "Share": (lambda value: _is_finite(value) and 0 <= value <= 1, "a share from 0 to 1"),
    "Count": (lambda value: is_count(value, 1), "a whole number of 1 or more"),
    "Natural": (is_count, "a whole number of 0 or more"),
    "int": (lambda value: is_count(value, None), "a whole number"),
    "bool": (lambda value: isinstance(value, bool | np.bool_), "True or False"),
    "str": (lambda value: isinstance(value, str), "a text"),
    "tuple[ObjectType, ...]": (_all(ObjectType), "ObjectTypes, such as (ObjectType.VEHICLE,)"),
    "tuple[MapFeatureType, ...]": (_all(MapFeatureType), "MapFeatureTypes, such as (MapFeatureType.BOUNDARY_LINE,)"),
}
"""By annotation: whether a value is one, and what is expected."""


def check_is(name: str, value: Any, kind: Any, expected: str) -> None:
    """Raise unless a value is of a kind, before something inside of it fails.

    Args:
        name: Name of the parameter.
        value: Its value.
        kind: A class or several, as for ``isinstance``.
        expected: What is expected, for the message.

    Raises:
        BadParameter: It is not.
    """
    if not isinstance(value, kind):
        raise BadParameter(f"{name}={value!r}; expected {expected}")


def check_settings(settings: Any) -> None:
    """Raise unless all settings that are numbers, truth values, texts or settings are what their annotations say.

    Args:
        settings: A dataclass; settings in it are checked if they have a default.

    Raises:
        BadParameter: One is not.
    """
    for each in fields(settings):
        value = getattr(settings, each.name)
        name = getattr(each.type, "__name__", each.type)
        kind = name.removesuffix(" | None")
        default = default_of(each)
        if kind in _KINDS:
            is_kind, expected = _KINDS[kind]
            is_right = is_kind(value)
        elif type(default).__name__ == kind and is_dataclass(default):
            is_right, expected = isinstance(value, type(default)), f"for example {kind}()"
        else:
            continue
        if not is_right and (value is not None or kind == name):
            raise BadParameter(f"{each.name}={value!r}; expected {expected}{'' if kind == name else ', or None'}")


def default_of(field: Field[Any]) -> Any:
    """Return the default of a field."""
    return field.default if field.default_factory is MISSING else field.default_factory()


def type_text(kind: Any) -> str:
    """Return a type as written in source code."""
    return kind.__name__ if isinstance(kind, type) else str(kind).replace("typing.", "")


def parse_texts(settings: type[Any], name: str, given: Mapping[str, Any]) -> dict[str, Any]:
    """Parse texts into values for the fields of a dataclass; values that are no texts are taken as they are.

    Args:
        settings: The dataclass.
        name: What has these settings, for error messages.
        given: Texts by name of the field: ``none`` for None, tuples with commas.

    Raises:
        BadParameter: A field is unknown or a text does not match its type; the message lists the valid ones.
    """
    hints, known, values = get_type_hints(settings), {each.name: each for each in fields(settings)}, {}
    for key, text in given.items():
        if key not in known:
            raise BadParameter(f"{name} has no setting {key!r}; it has {', '.join(known) or 'none'}")
        try:
            values[key] = _parsed(hints[key], text) if isinstance(text, str) else text
        except (ValueError, KeyError) as error:
            wanted = f"{type_text(hints[key])}, for example {default_of(known[key])!r}"
            raise BadParameter(f"{name}: {key} wants {wanted}; found {text!r}") from error
    return values


_WORDS = {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}


def _parsed(wanted: Any, word: str) -> Any:
    """Convert a word to the wanted type; raises ValueError or KeyError where that is impossible."""
    origin, inner = get_origin(wanted), get_args(wanted)
    if origin in (Union, UnionType):
        if type(None) in inner and word.lower() == "none":
            return None
        return _parsed(next(kind for kind in inner if kind is not type(None)), word)
    if origin is Literal:
        return {str(value): value for value in inner}[word]
    if origin is tuple:
        words = word.split(",") if word else []
        kinds = [inner[0]] * len(words) if inner[-1] is Ellipsis else inner
        return tuple(_parsed(kind, each) for kind, each in zip(kinds, words, strict=True))
    return _WORDS[word.lower()] if wanted is bool else wanted(word)
