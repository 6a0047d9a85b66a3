"""Formats of other simulators and tools: one folder a format, with a writer, a reader or both.

    base      what a writer is, and the report of what a format cannot hold
    files     a database as files of a format: in parts, resumable
    viewing   what viewers draw of a scenario
    roads     from a lane graph to roads with parallel lanes, for the formats that have roads

Readers are converters (``scenarionet_data.converters``), registered there by name.
"""

from __future__ import annotations

import difflib
import importlib
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from scenarionet_data.errors import BadParameter, MissingDependency

if TYPE_CHECKING:
    from scenarionet_data.interchange.base import FormatWriter

WRITERS = {
    "commonroad": "scenarionet_data.interchange.commonroad.writer:CommonRoadWriter",
    "gpudrive": "scenarionet_data.interchange.gpudrive.writer:GpuDriveWriter",
    "lanelet2": "scenarionet_data.interchange.lanelet2.writer:Lanelet2Writer",
    "mcap": "scenarionet_data.interchange.mcap.writer:McapWriter",
    "opendrive": "scenarionet_data.interchange.opendrive.writer:OpenDriveWriter",
    "openscenario": "scenarionet_data.interchange.openscenario.writer:OpenScenarioWriter",
    "pufferdrive": "scenarionet_data.interchange.pufferdrive.writer:PufferDriveWriter",
    "rerun": "scenarionet_data.interchange.rerun.writer:RerunWriter",
    "rosbag": "scenarionet_data.interchange.ros.writer:RosbagWriter",
    "rosbag2": "scenarionet_data.interchange.ros.writer:Rosbag2Writer",
    "sumo": "scenarionet_data.interchange.sumo.writer:SumoWriter",
    "waymax": "scenarionet_data.interchange.waymax.writer:WaymaxWriter",
}
"""Class of each writer by the name of its format."""


def writer_class(name: str) -> type[Any]:
    """Return the class of a format's writer, a dataclass whose fields are its options.

    Args:
        name: A name in ``WRITERS``.

    Raises:
        BadParameter: Unknown format, with those that exist.
        MissingDependency: The format needs a library that is not installed.
    """
    if name not in WRITERS:
        near = difflib.get_close_matches(name, WRITERS, n=3) or sorted(WRITERS)
        raise BadParameter(f"no format {name!r} to export to; did you mean {', '.join(near)}?")
    module, _, attribute = WRITERS[name].partition(":")
    try:
        kind: type[Any] = getattr(importlib.import_module(module), attribute)
    except ModuleNotFoundError as error:
        extra = "ros" if name.startswith("rosbag") else "viewers"
        raise MissingDependency(f"the format {name} needs {error.name}", extra) from error
    return kind


def writer_for(name: str, options: Mapping[str, Any] | None = None) -> FormatWriter:
    """Return the writer of a format with options, the fields of its class.

    Raises:
        BadParameter: Unknown format or option, with those that exist.
        MissingDependency: The format needs a library that is not installed.
    """
    kind = writer_class(name)
    known = kind.__dataclass_fields__
    unknown = sorted(set(options or {}) - set(known))
    if unknown:
        raise BadParameter(f"{name} has no option {unknown[0]!r}; it has {', '.join(known) or 'none'}")
    writer: FormatWriter = kind(**(options or {}))
    return writer
