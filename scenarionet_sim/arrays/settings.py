"""What settings that are dataclasses have in common."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import TYPE_CHECKING

from scenarionet_data.arrays.dtypes import is_number
from scenarionet_data.errors import BadParameter

if TYPE_CHECKING:
    from _typeshed import DataclassInstance


def check_numbers(settings: DataclassInstance) -> None:
    """Raise unless all settings that are numbers are finite ones.

    Raises:
        BadParameter: One is not.
    """
    for each in fields(settings):
        value = getattr(settings, each.name)
        if each.type in ("float", "int") and not (is_number(value) and math.isfinite(value)):
            raise BadParameter(f"{each.name}={value!r}; expected a finite number")
