"""Read nuScenes' map expansion, version 1.3 (``maps/expansion/<location>.json``): layers and their geometry.

A layer is a list of records, which refer to polygons and lines, which refer to nodes with coordinates in the
location's plane frame [m]. The first polygon of a file has no token and is unused, and a few lines have no nodes.
There are no heights. Lines and outlines go on without nodes that cannot be used; a feature that cannot be read is
dropped, and both are reported.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from shapely.errors import ShapelyError

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.building.plausible import MAX_MAP_DISTANCE, find_middle
from scenarionet_data.converters.nuscenes.dubins import are_paths
from scenarionet_data.ingest.defects import Defects

LayerRecord = dict[str, Any]

_VERSION = "1.3"
_GEOMETRY = ("node", "line", "polygon")
_LISTS = (
    *_GEOMETRY,
    *("drivable_area", "road_segment", "road_block", "lane", "ped_crossing", "walkway", "stop_line", "carpark_area"),
    *("road_divider", "lane_divider", "traffic_light", "lane_connector"),
)
_LARGEST = 1e15
"""Bound of a number [m] from which distances can be computed."""
_MAPPINGS = ("arcline_path_3", "connectivity")


class BadFeature(ValueError):
    """A feature that cannot be read: what was expected and found."""


class Expansion:
    """A map expansion.

    Attributes:
        defects: Features that were dropped or assumed.

    Args:
        content: The parsed file.
        file: Its path relative to the raw folder, for reports.

    Raises:
        ValueError: Not a map expansion, or of another version; the message has what was found.
    """

    def __init__(self, content: Any, file: str) -> None:
        if not isinstance(content, dict) or not isinstance(content.get("version", "1.0"), str):
            raise ValueError("no JSON object with a version")
        if content.get("version") != _VERSION:
            raise ValueError(f"version {content.get('version', '1.0')[:16]!r}")
        for kind, names in ((list, _LISTS), (dict, _MAPPINGS)):
            lost = [name for name in names if not isinstance(content.get(name), kind)]
            if lost:
                raise ValueError(f"no layer {lost[0]!r}")
        self.defects = Defects()
        self._file = file
        self._paths, self._links = content["arcline_path_3"], content["connectivity"]
        self._has_good_paths = are_paths(
            [path for paths in self._paths.values() for path in (paths if isinstance(paths, list) else [paths])]
        )
        self._nodes = _nodes(content["node"])
        self._lines = {record["token"]: record for record in _named(content["line"])}
        self._polygons = {record["token"]: record for record in _named(content["polygon"])}
        self._layers = {name: self._features(name, content[name]) for name in _LISTS if name not in _GEOMETRY}

    def _features(self, layer: str, entries: list[Any]) -> list[LayerRecord]:
        """Records of a layer with a token of their own; a record without one (None) is unused."""
        found = {record["token"]: record for record in reversed(list(_named(entries)))}
        unused = sum(isinstance(entry, dict) and entry.get("token", "") is None for entry in entries)
        lost = len(entries) - unused - len(found)
        self.defects.drop("maps", self._file, [layer] * lost, "token", "expected a token of its own, found none")
        return list(reversed(found.values()))

    def layer(self, name: str) -> list[LayerRecord]:
        """Records of a layer that have a token."""
        return self._layers[name]

    @contextmanager
    def dropping(self, layer: str, record: LayerRecord) -> Iterator[None]:
        """Drop and report the feature of a record if it cannot be read."""
        try:
            yield
        except BadFeature as error:
            self.defects.drop("maps", self._file, [record["token"]], layer, str(error))
        except (KeyError, TypeError, ValueError, AttributeError, IndexError, OverflowError, ShapelyError):
            wanted = "expected the fields of the layer, found others"
            self.defects.drop("maps", self._file, [record["token"]], layer, wanted)

    def assume(self, layer: str, token: str, reason: str) -> None:
        """Report a feature that is kept without a part of it."""
        self.defects.assume("maps", self._file, [token], layer, reason)

    def paths(self, lane: str) -> Sequence[LayerRecord]:
        """Dubins paths of a lane's centreline; some lanes have none."""
        stated = self._paths.get(lane, [])
        if self._has_good_paths:
            return list(stated)
        paths = [path for path in stated if are_paths([path])] if isinstance(stated, list) else []
        if not isinstance(stated, list) or len(paths) < len(stated):
            self.assume("arcline_path_3", lane, "expected Dubins paths, found others; the centreline is without them")
        return paths

    def links(self, lane: str) -> tuple[list[str], list[str]]:
        """Predecessors and successors of a lane."""
        stated = self._links.get(lane, {})
        lists = (
            [stated.get(name, []) for name in ("incoming", "outgoing")] if isinstance(stated, dict) else [None, None]
        )
        entries, exits = (words(each) for each in lists)
        if [entries, exits] != lists:
            self.assume("connectivity", lane, "expected lists of lanes, found others; left out")
        return entries, exits

    def line(self, layer: str, record: LayerRecord) -> Float64:
        """(n, 2) points of the line of a record [m]; n may be 0."""
        line = self._lines.get(_reference(record, "line_token"))
        if line is None:
            raise BadFeature("expected a known line, found none")
        return self._points(layer, record["token"], line.get("node_tokens"), least=2)

    def node(self, token: Any) -> tuple[float, float] | None:
        """x, y of a node [m]; None if it cannot be used."""
        return self._nodes.get(token) if isinstance(token, str) else None

    def polygon(self, layer: str, record: LayerRecord, token: Any = None) -> tuple[Float64, list[Float64]]:
        """Exterior (n, 2) and holes (k, 2) of the polygon of a record [m], or of a token; n may be 0."""
        polygon = self._polygons.get(_reference(record, "polygon_token") if token is None else token)
        if polygon is None:
            raise BadFeature("expected a known polygon, found none")
        exterior = self._points(layer, record["token"], polygon.get("exterior_node_tokens"), least=3)
        holes = []
        for hole in polygon.get("holes") or ():
            try:
                holes.append(self._points(layer, record["token"], hole.get("node_tokens"), least=0))
            except (BadFeature, AttributeError):
                self.assume(layer, record["token"], "expected holes as lists of nodes, found others; left out")
        return exterior, [hole for hole in holes if len(hole) >= 3]

    def _points(self, layer: str, token: str, nodes: Any, least: int) -> Float64:
        if not isinstance(nodes, list):
            raise BadFeature("expected a list of nodes, found none")
        if len(nodes) >= least or not nodes:
            try:
                return np.array([self._nodes[node] for node in nodes], np.float64).reshape(-1, 2)
            except (KeyError, TypeError):  # a node is unknown, or its reference is no text
                self.assume(layer, token, "expected known nodes with finite coordinates, found others; left out")
        found = [place for place in map(self.node, nodes) if place is not None]
        if len(found) < least:
            raise BadFeature(f"expected {least} nodes or more, found {len(found)} that can be used")
        return np.array(found, np.float64).reshape(-1, 2)


def read_expansion(path: Path, file: str) -> Expansion:
    """Read one location's map expansion; ``file`` is its path relative to the raw folder.

    Raises:
        OSError, ValueError: Missing or damaged.
    """
    try:
        content = json.loads(path.read_bytes())
    except (UnicodeDecodeError, json.JSONDecodeError, RecursionError) as error:
        raise ValueError("no JSON") from error
    return Expansion(content, file)


def words(value: Any) -> list[str]:
    """The texts in a list."""
    return [each for each in value if isinstance(each, str)] if isinstance(value, list) else []


def _reference(record: LayerRecord, field: str) -> str:
    token = record.get(field)
    return token if isinstance(token, str) else ""


def _named(entries: Iterable[Any]) -> Iterator[LayerRecord]:
    """Records with a text as token."""
    for entry in entries:
        if isinstance(entry, dict) and isinstance(entry.get("token"), str) and entry["token"]:
            yield entry


def _nodes(entries: list[Any]) -> Mapping[str, tuple[float, float]]:
    """x, y [m] of the usable nodes by token."""
    found = {
        node["token"]: (node["x"], node["y"])
        for node in _named(entries)
        if type(node.get("x")) in (int, float) and type(node.get("y")) in (int, float)
    }
    places = np.array(list(found.values())).reshape(-1, 2)
    if places.dtype == object:  # integers beyond 64 bits
        places = np.where(np.abs(places) < _LARGEST, places, np.inf).astype(np.float64)
    is_near = np.abs(places - find_middle(places)).max(axis=1, initial=0.0) <= MAX_MAP_DISTANCE
    return {
        token: (float(x), float(y))
        for (token, (x, y)), near in zip(found.items(), is_near.tolist(), strict=True)
        if near
    }
