"""Options of the converter of Lyft's dataset."""

from __future__ import annotations

from dataclasses import dataclass, field

from scenarionet_data.errors import BadParameter
from scenarionet_data.ingest.options import Options

DT = 0.1
"""Nominal time between frames [s]."""


@dataclass(frozen=True)
class LyftOptions(Options):
    """Windows, map and objects of scenarios."""

    window: float = field(default=20.0, metadata={"doc": "Length of a scenario [s]; scenes last about 25 s."})
    stride: float = field(default=0.0, metadata={"doc": "Time between the starts of two windows [s]; 0: the window."})
    radius: float = field(
        default=100.0, metadata={"doc": "Margin of the map around the bounding box of the ego's path [m]."}
    )
    has_map: bool = field(
        default=True, metadata={"doc": "Whether scenarios get a map, from semantic_map.pb and meta.json."}
    )
    maps: str = field(
        default="", metadata={"doc": "Folder of semantic_map.pb and meta.json; empty: below RAW.", "is_path": True}
    )
    keep_unknown: bool = field(
        default=True, metadata={"doc": "Keep objects whose label is unknown, two thirds of all; they are OTHER."}
    )

    def __post_init__(self) -> None:
        if not (self.window >= DT and (self.stride == 0 or self.stride >= DT)):
            found = f"found {self.window} and {self.stride}"
            raise BadParameter(f"window, stride: expected {DT} s or more (or a stride of 0), {found}")
        if not 0.0 <= self.radius < 1e6:
            raise BadParameter(f"radius: expected 0 m or more, found {self.radius}")
