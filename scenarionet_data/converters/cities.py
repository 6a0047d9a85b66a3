"""The map of a city, which scenarios share, and the part of it around an ego's path."""

from __future__ import annotations

from dataclasses import dataclass, field

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.building import MapBuilder
from scenarionet_data.scenario.description import MapFeatures


@dataclass(frozen=True, eq=False)
class CityMap:
    """A shared map in its own frame.

    Attributes:
        features: The whole map.
        bounds: (M, 4) min_x, min_y, max_x, max_y [m] of each feature.
    """

    features: MapBuilder
    bounds: Float64 = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "bounds", self.features.bounds)

    def around(
        self, path: Float64, radius: float, origin: Float64, has_z: bool = False
    ) -> tuple[MapFeatures, tuple[float, float, float, float]]:
        """Return the features around a path (n, 2 or more) [m], and the window, both relative to ``origin``.

        The window is the bounding box of the path plus ``radius`` [m] on each side.
        """
        low, high = path[:, :2].min(axis=0) - radius, path[:, :2].max(axis=0) + radius
        features = self.features.crop((*low.tolist(), *high.tolist()), self.bounds)
        return features.build(origin, has_z), (*(low - origin[:2]).tolist(), *(high - origin[:2]).tolist())


def complete_links(entries: dict[str, list[str]], exits: dict[str, list[str]]) -> int:
    """Make links between lanes mutual: a lane is an entry of its exits, and an exit of its entries.

    Args:
        entries, exits: Predecessors and successors of each lane; lanes outside the map may be among them.

    Returns:
        The number of links that were added.
    """
    added = 0
    for ahead, back in ((exits, entries), (entries, exits)):
        for lane, others in ahead.items():
            for links in [back[other] for other in others if other in back]:
                if lane not in links:
                    links.append(lane)
                    added += 1
    return added
