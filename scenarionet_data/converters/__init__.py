"""Registry of converters by dataset name.

Installed packages register converters under the entry point group ``scenarionet.converters``; any other converter is
named as ``module:Class``.
"""

from __future__ import annotations

import difflib
import importlib
from functools import cache
from importlib.metadata import entry_points
from typing import Any

from scenarionet_data.converters.base import Budgets, Converter
from scenarionet_data.errors import SourceNotFound

_BUILTIN = {
    "argoverse1": "scenarionet_data.converters.argoverse1:Argoverse1",
    "argoverse2": "scenarionet_data.converters.argoverse2:Argoverse2",
    "commonroad": "scenarionet_data.interchange.commonroad.reader:CommonRoad",
    "gpudrive": "scenarionet_data.interchange.gpudrive.reader:GpuDrive",
    "interaction": "scenarionet_data.converters.interaction:Interaction",
    "logical": "scenarionet_data.logical.converter:Logical",
    "lyft": "scenarionet_data.converters.lyft:Lyft",
    "nuplan": "scenarionet_data.converters.nuplan:NuPlan",
    "nuscenes": "scenarionet_data.converters.nuscenes:NuScenes",
    "openscenario": "scenarionet_data.interchange.openscenario.reader:OpenScenario",
    "pg": "scenarionet_data.converters.pg:Procedural",
    "pufferdrive": "scenarionet_data.interchange.pufferdrive.reader:PufferDrive",
    "scenarionet": "scenarionet_data.converters.scenarionet:ScenarioNetPickles",
    "sumo": "scenarionet_data.interchange.sumo.reader:Sumo",
    "table": "scenarionet_data.converters.table:TrackTable",
    "waymo": "scenarionet_data.converters.waymo:Waymo",
}

_ALIASES = {"av1": "argoverse1", "av2": "argoverse2", "nuscenes-mini": "nuscenes"}
"""Other names of datasets that people type."""


def names() -> list[str]:
    """Return the names of all converters, built in and installed."""
    return sorted({*_BUILTIN, *(point.name for point in _installed())})


def get(name: str) -> Converter[Any]:
    """Return the converter of a name, of an alias such as ``av2``, or of a class given as ``module:Class``.

    Raises:
        SourceNotFound: Unknown name, with the closest ones; or the class cannot be imported.
    """
    if not isinstance(name, str):
        raise SourceNotFound(f"no converter {name!r}; expected a name such as {', '.join(names()[:3])}")
    if ":" in name:
        return _instance(name)
    for point in _installed():
        if point.name == name:
            return _instance(point.value)
    name = _ALIASES.get(name, name)
    if name not in _BUILTIN:
        near = ", ".join(difflib.get_close_matches(name, [*names(), *_ALIASES], n=3))
        raise SourceNotFound(
            f"no converter {name!r}; " + (f"did you mean {near}?" if near else f"expected {', '.join(names())}")
        )
    return _instance(_BUILTIN[name])


def budgets(dataset: str) -> Budgets:
    """Return the budgets of a dataset's converter, or the defaults if that converter is not installed."""
    return get(dataset).budgets if dataset in names() else Budgets()


def _instance(reference: str) -> Converter[Any]:
    module, _, attribute = reference.partition(":")
    try:
        converter: Converter[Any] = getattr(importlib.import_module(module), attribute)()
    except (ModuleNotFoundError, AttributeError) as error:
        raise SourceNotFound(f"cannot load converter {reference}: {error}; is its package installed?") from error
    return converter


@cache
def _installed() -> Any:
    """Entry points of converters; finding them reads the metadata of every installed package."""
    return entry_points(group="scenarionet.converters")
