"""Read nuScenes' map expansion, version 1.3 (``maps/expansion/<location>.json``): layers and their geometry.

A layer is a list of records, which refer to polygons and lines, which refer to nodes with coordinates in the
location's plane frame [m]. The first polygon of a file has no token and is unused, and a few lines have no nodes.
There are no heights.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Float64

LayerRecord = dict[str, Any]

_VERSION = "1.3"


class Expansion:
    """A map expansion; unknown layers and tokens raise KeyError.

    Args:
        content: The parsed file.

    Raises:
        KeyError, TypeError, ValueError: Not a map expansion, or of another version.
    """

    def __init__(self, content: LayerRecord) -> None:
        if content.get("version") != _VERSION:
            raise ValueError(f"version {content.get('version', '1.0')!r}, expected {_VERSION!r}")
        self._content = content
        self._nodes = {node["token"]: (float(node["x"]), float(node["y"])) for node in content["node"]}
        self._lines = {line["token"]: line["node_tokens"] for line in content["line"]}
        self._polygons = {polygon["token"]: polygon for polygon in content["polygon"]}
        if not np.isfinite(np.array(list(self._nodes.values()))).all():
            raise ValueError("a node whose coordinates are not finite")

    def layer(self, name: str) -> list[LayerRecord]:
        """Records of a layer that have a token."""
        return [record for record in self._content[name] if record["token"]]

    def paths(self, lane: str) -> Sequence[LayerRecord]:
        """Dubins paths of a lane's centreline; some lanes have none."""
        paths: Sequence[LayerRecord] = self._content["arcline_path_3"].get(lane, ())
        return paths

    def links(self, lane: str) -> tuple[list[str], list[str]]:
        """Predecessors and successors of a lane."""
        links = self._content["connectivity"].get(lane, {"incoming": [], "outgoing": []})
        return list(links["incoming"]), list(links["outgoing"])

    def nodes(self, line: str) -> list[str]:
        """Tokens of a line's nodes."""
        return list(self._lines[line])

    def points(self, nodes: Sequence[str]) -> Float64:
        """(n, 2) coordinates of nodes [m]."""
        return np.array([self._nodes[node] for node in nodes], np.float64).reshape(-1, 2)

    def polygon(self, token: str) -> tuple[Float64, list[Float64]]:
        """Exterior (n, 2) and holes (k, 2) of a polygon [m]; n is 0 for a polygon without nodes.

        Raises:
            ValueError: It has one or two nodes.
        """
        record = self._polygons[token]
        exterior = self.points(record["exterior_node_tokens"])
        if 0 < len(exterior) < 3:
            raise ValueError(f"polygon {token} of {len(exterior)} nodes")
        holes = [self.points(hole["node_tokens"]) for hole in record["holes"]]
        return exterior, [hole for hole in holes if len(hole) >= 3]


def read_expansion(path: Path) -> Expansion:
    """Read one location's map expansion.

    Raises:
        OSError, KeyError, TypeError, ValueError: Missing or damaged.
    """
    content = json.loads(path.read_bytes())
    if not isinstance(content, dict):
        raise TypeError("no JSON object")
    return Expansion(content)
