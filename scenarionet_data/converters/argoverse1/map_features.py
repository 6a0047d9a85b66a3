"""Read Argoverse 1's ``pruned_argoverse_<city>_<number>_vector_map.xml``: the lanes of a city.

Nodes are points (``<node id x y>``), ways are lanes: ``<way lane_id>`` with a centreline of node references and
tags. Frame: the city's, in metres; heights, present in some files, are dropped because objects have none. Lanes have
a centreline only; their width is 3.8 m, as in argoverse-api. Lanes removed by pruning are still listed as neighbours,
successors and predecessors.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.building import METRES, MapBuilder, meets, rounded
from scenarionet_data.converters.argoverse1.lanes import Argoverse1Lane, LaneNeighbors, read_lanes, sort_sides
from scenarionet_data.converters.cities import complete_links
from scenarionet_data.errors import CorruptSource
from scenarionet_data.ingest.defects import Defects
from scenarionet_data.ingest.listing import cached_by_file
from scenarionet_data.scenario.description import MapFeatures
from scenarionet_data.scenario.vocabulary import MapFeatureType

WIDTH = 3.8
"""Width of a lane [m], as assumed in argoverse-api (``utils/centerline_utils.py``, ``utils/manhattan_search.py``)."""

_NAME = re.compile(r"pruned_argoverse_([A-Za-z]+)_(\d+)_vector_map\.xml")
_KEPT_CITIES = 2


@dataclass(frozen=True, eq=False)
class Argoverse1City:
    """A city's map, in the city's frame.

    Attributes:
        map_id: For example ``MIA-10316``.
        features: The whole map.
        centers: Centreline of each feature, points (P, 2) float64 [m].
    """

    map_id: str
    features: MapBuilder
    centers: Ragged

    @cached_property
    def _bounds(self) -> Float64:
        return self.features.bounds

    @cached_property
    def _flat(self) -> MapFeatures:
        return self.features.build(np.zeros(3), has_z=False)

    def crop(self, window: tuple[float, float, float, float], origin: Float64) -> MapFeatures:
        """Return ``features.crop(window).build(origin, has_z=False)``, several times as fast.

        Args:
            window: min_x, min_y, max_x, max_y [m] in the city's frame.
            origin: (3,) [m] of the scenario.
        """
        rows = np.flatnonzero(meets(self._bounds, window))
        near = self.centers.take(rows)
        points = np.zeros((len(near.values), 3), np.float32)
        points[:, :2] = rounded(near.values - origin[:2], METRES)
        return replace(self._flat.take(rows), polyline=Ragged(near.offsets, points))


def find_maps(places: str) -> dict[str, Path]:
    """Find vector maps in folders, at any depth, by city; the newest if a city has several.

    Args:
        places: Folders or map files, separated as in ``$PATH``.
    """
    files: list[str] = []
    for place in places.split(os.pathsep):
        files += map(str, Path(place).rglob("*_vector_map.xml")) if Path(place).is_dir() else [place]
    return maps_by_city(os.pathsep.join(files))


@lru_cache(maxsize=16)
def maps_by_city(files: str) -> dict[str, Path]:
    """:func:`find_maps` for map files, cached per process."""
    paths = [Path(file) for file in files.split(os.pathsep)]
    found = [(match, path) for path in paths if (match := _NAME.fullmatch(path.name))]
    found.sort(key=lambda pair: (pair[0][1], int(pair[0][2]), pair[1]))
    return {match[1]: path for match, path in found}


def map_id(path: Path) -> str:
    """Return the id of a map from its file's name."""
    match = _NAME.fullmatch(path.name)
    return f"{match[1]}-{match[2]}" if match else path.stem


@cached_by_file(_KEPT_CITIES)
def read_city(path: Path) -> Argoverse1City:
    """Read a city's map; a process caches a few.

    Raises:
        CorruptSource: The map is missing, no XML, or without lanes.
    """
    if not path.is_file():
        raise CorruptSource(f"{path}: no such map; download the HD maps again")
    try:
        root = ElementTree.fromstring(path.read_bytes())  # noqa: S314  # expat refuses entities that explode
    except (OSError, ElementTree.ParseError, ValueError, LookupError) as error:
        raise CorruptSource(f"{path}: expected an Argoverse 1 vector map ({error}); download it again") from error
    defects = Defects()
    lanes, centers = read_lanes(root, path.name, defects)
    if not lanes:
        raise CorruptSource(f"{path}: expected an Argoverse 1 vector map, found no lane in it; download it again")
    complete_links({lane.id: lane.entries for lane in lanes}, {lane.id: lane.exits for lane in lanes})
    known = {lane.id: row for row, lane in enumerate(lanes)}
    neighbors = [(lane.neighbor("l_neighbor_id"), lane.neighbor("r_neighbor_id")) for lane in lanes]
    builder = MapBuilder()
    for lane, center, sides in zip(lanes, centers, sort_sides(neighbors, known, centers), strict=True):
        builder.add(
            lane.id,
            MapFeatureType.LANE_SURFACE_STREET,
            polyline=center,
            width=[[WIDTH / 2.0, WIDTH / 2.0]],
            entry_lanes=lane.entries,
            exit_lanes=lane.exits,
            left_neighbors=sides.left,
            right_neighbors=sides.right,
            is_intersection=lane.is_true("is_intersection"),
            extras=dict(_extras(lane, sides, known)),
        )
    builder.defects = defects.found()
    return Argoverse1City(map_id(path), builder, centers)


def _extras(lane: Argoverse1Lane, sides: LaneNeighbors, known: dict[str, int]) -> Iterator[tuple[str, object]]:
    yield "is_width_assumed", True
    yield "has_traffic_control", lane.is_true("has_traffic_control")
    yield "turn_direction", lane.tags.get("turn_direction", "NONE")
    if sides.opposite:
        yield "opposite_neighbors", sides.opposite
    if sides.moved:
        yield "neighbors_of_other_side", sides.moved
    pruned = [other for other in [*lane.entries, *lane.exits, *sides.left, *sides.right] if other not in known]
    if pruned:
        yield "lanes_outside_map", pruned
