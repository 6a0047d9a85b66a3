"""Parsers of values that several verbs take."""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import click

from scenarionet_data.errors import BadParameter
from scenarionet_data.storage.files.places import local_path


class FiniteRange(click.FloatRange):
    """Numbers of a range, without NaN and infinity, which ``FloatRange`` takes."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return the number."""
        number = float(super().convert(value, param, ctx))
        if not math.isfinite(number):
            self.fail(f"{value} is not a finite number", param, ctx)
        return number


def output_path(file: str, what: str, *, replace: bool) -> Path:
    """Return the path of a file to write.

    Args:
        file: The path as typed.
        what: What is written, for error messages: "a picture".
        replace: Whether it may exist.

    Raises:
        BadParameter: It exists, or it is a URL.
    """
    path = local_path(file, what)
    if path.exists() and not replace:
        raise BadParameter(f"{file} exists; choose another name, or --replace")
    return path


def look_in_current_folder(name: str) -> None:
    """Make modules of the current folder importable for ``module:Class``, also in worker processes."""
    here = str(Path.cwd())
    if ":" in name and here not in sys.path:
        sys.path.append(here)


def pairs(words: Iterable[str], option: str) -> dict[str, str]:
    """Parse ``key=value`` words into a mapping.

    Args:
        words: Words as typed.
        option: The option that takes them, for error messages.

    Raises:
        BadParameter: A word has no ``=``, or a key is repeated.

    Example:
        >>> pairs(["train=0.9", "val=0.1"], "--fractions")
        {'train': '0.9', 'val': '0.1'}
    """
    found: dict[str, str] = {}
    for word in words:
        key, equals, value = word.partition("=")
        if not equals or not key:
            raise BadParameter(f"{option} expects name=value, found {word!r}")
        if key in found:
            raise BadParameter(f"{option} has {key!r} twice")
        found[key] = value
    return found


_UNITS = {"s": 1.0, "min": 60.0, "h": 3600.0, "d": 24 * 3600.0, "w": 7 * 24 * 3600.0}


def seconds(text: str, option: str, *, allow_zero: bool = False) -> float:
    """Parse a duration such as ``30s``, ``90min``, ``12h``, ``7d`` or ``2w`` and return seconds.

    Args:
        text: Duration as typed.
        option: The option that takes it, for error messages.
        allow_zero: Accept 0.

    Raises:
        BadParameter: The text is not a positive duration with a unit.

    Example:
        >>> seconds("5min", "--every")
        300.0
    """
    match = re.fullmatch(r"(\d+(?:\.\d+)?)\s*(s|min|h|d|w)", text.strip())
    if not match or not (allow_zero or float(match[1])):
        raise BadParameter(f"{option} expects a duration such as 30s, 90min, 12h, 7d or 2w, found {text!r}")
    return float(match[1]) * _UNITS[match[2]]
