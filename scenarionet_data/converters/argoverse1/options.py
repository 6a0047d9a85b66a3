"""Options of the Argoverse 1 converter."""

from __future__ import annotations

from dataclasses import dataclass, field

from scenarionet_data.errors import BadParameter
from scenarionet_data.ingest.options import Frames, Options


@dataclass(frozen=True)
class Argoverse1Options(Options):
    """Timesteps, location of the maps, and the extent of a scenario's map."""

    frames: Frames = field(
        default="recorded",
        metadata={
            "doc": "recorded: the 50 or 20 recorded times; resampled: every 0.1 s, interpolated.",
            "is_added": True,
        },
    )

    maps: str = field(
        default="", metadata={"doc": "Folder of the *_vector_map.xml; empty: below RAW.", "is_path": True}
    )
    has_map: bool = field(default=True, metadata={"doc": "Whether scenarios get a map."})
    radius: float = field(
        default=100.0, metadata={"doc": "Margin of the map around the bounding box of the ego's path [m]."}
    )

    def __post_init__(self) -> None:
        if not 0.0 <= self.radius < 1e5:
            raise BadParameter(f"radius: expected 0 m or more, found {self.radius}")
