"""What the converter of Lyft's dataset can be told."""

from __future__ import annotations

from dataclasses import dataclass, field

from scenarionet_data.errors import BadParameter
from scenarionet_data.ingest.options import Options

DT = 0.1
"""Nominal time between frames [s]."""


@dataclass(frozen=True)
class LyftOptions(Options):
    """How scenes are cut into scenarios, and what of them is kept."""

    window: float = field(default=20.0, metadata={"doc": "Seconds of a scenario; scenes last about 25."})
    stride: float = field(default=0.0, metadata={"doc": "Seconds from one window to the next; 0: as the window."})
    radius: float = field(default=100.0, metadata={"doc": "Metres of map around the box that holds the ego's path."})
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
            raise BadParameter(f"radius: expected metres of 0 or more, found {self.radius}")
