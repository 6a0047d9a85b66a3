"""Planners of CommonRoad by name: ``commonroad:reactive``, ``commonroad:frenetix``.

Their packages need other versions of packages than this software may, so they run in an environment of their own.
"""

from __future__ import annotations

import importlib
import os
import sys
from importlib import metadata
from typing import NamedTuple

from scenarionet_data.errors import BadParameter
from scenarionet_sim.planners.base import Planner

PREFIX = "commonroad:"

ENVIRONMENT = "SCENARIONET_PLANNERS"
"""Variable that names the interpreter of their environment."""


class _Outside(NamedTuple):
    module: str
    name: str
    packages: tuple[str, ...]


PLANNERS = {
    "commonroad:reactive": _Outside("reactive", "CommonRoadReactive", ("commonroad-reactive-planner",)),
    "commonroad:frenetix": _Outside("frenetix", "CommonRoadFrenetix", ("frenetix", "commonroad-clcs")),
}
_SHARED = ("commonroad-io", "commonroad-drivability-checker", "numpy")


def is_outside(policy: str) -> bool:
    """Return whether the name of a policy is that of a planner of CommonRoad."""
    return policy.startswith(PREFIX)


def environment_of(policy: str, python: str = "") -> str:
    """Return the interpreter of a policy: of these planners that of the variable, or another process of this one."""
    return python or (os.environ.get(ENVIRONMENT, "") or sys.executable if is_outside(policy) else "")


def load_planner(policy: str) -> type[Planner]:
    """Return the class of a planner, in its environment.

    Raises:
        BadParameter: There is no such planner, or its packages are not in this environment.
    """
    if policy not in PLANNERS:
        raise BadParameter(f"unknown policy {policy!r}; choose from {', '.join(PLANNERS)}")
    module, name, packages = PLANNERS[policy]
    try:
        kind: type[Planner] = getattr(importlib.import_module(f"{__package__}.{module}"), name)
    except ModuleNotFoundError as error:
        raise BadParameter(
            f"{policy} needs {packages[0]}, which {sys.executable} lacks ({error}); make an environment with it "
            f"(`make planners`, or docs/guides/planners.md), and name its interpreter by --python or {ENVIRONMENT}"
        ) from error
    return kind


def versions_of(policy: str) -> str:
    """Return the packages of a planner and their versions, in its environment; a run keeps them."""
    return ", ".join(f"{each} {metadata.version(each)}" for each in (*PLANNERS[policy].packages, *_SHARED))
