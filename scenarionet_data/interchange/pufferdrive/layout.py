"""The bytes of PufferDrive's maps: little-endian, without padding, in two layouts.

Layout 2 (PufferDrive 2.0, ``pufferlib/ocean/drive/map_io.py``) begins with the row of the ego and those of the tracks
to predict, and gives each entity the number of its map and an id; layout 1 (pufferlib 3.0) has neither. Then follow
the numbers of objects and roads, and these as entities: type, number of points, x, y, z; of objects also velocities,
headings and validity; then width, length, height, goal and whether a recorded path is followed.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float32
from scenarionet_data.errors import CorruptSource

VEHICLE, PEDESTRIAN, CYCLIST, LANE, LINE, EDGE, STOP_SIGN, CROSSWALK, SPEED_BUMP, DRIVEWAY = range(1, 11)
OBJECT_TYPES = {"vehicle": VEHICLE, "pedestrian": PEDESTRIAN, "cyclist": CYCLIST}
ROAD_TYPES = {
    "lane": LANE, "road_line": LINE, "road_edge": EDGE, "stop_sign": STOP_SIGN, "crosswalk": CROSSWALK,
    "speed_bump": SPEED_BUMP, "driveway": DRIVEWAY,
}  # fmt: skip
_LONGEST = 1_000_000  # points of an entity or entities of a map, beyond which a file is damaged


@dataclass(frozen=True)
class Entity:
    """An object or a road.

    Attributes:
        kind: Its type, one of the numbers above.
        id: Its id, which only layout 2 holds.
        position: (P, 3) float32 [m].
        velocity: (P, 3) float32 [m/s]; None for roads.
        heading: (P,) float32 [rad]; None for roads.
        valid: (P,) bool; None for roads.
        size: Width, length and height [m]; zeros for roads.
        goal: x, y, z [m]; zeros for roads.
        is_expert: Whether it follows its recorded path.
    """

    kind: int
    id: int
    position: Float32
    velocity: Float32 | None = None
    heading: Float32 | None = None
    valid: Bool | None = None
    size: tuple[float, float, float] = (0.0, 0.0, 0.0)
    goal: tuple[float, float, float] = (0.0, 0.0, 0.0)
    is_expert: bool = False


@dataclass(frozen=True)
class PufferMap:
    """A map: its objects and roads, the row of the ego, and the rows of tracks to predict (layout 2)."""

    objects: list[Entity]
    roads: list[Entity]
    ego: int = -1
    predicted: tuple[int, ...] = ()


def encode(puffer_map: PufferMap, layout: int) -> bytes:
    """Return the bytes of a map in layout 1 or 2."""
    parts = []
    if layout == 2:
        parts.append(
            struct.pack(
                f"<{2 + len(puffer_map.predicted)}i", puffer_map.ego, len(puffer_map.predicted), *puffer_map.predicted
            )
        )
    parts.append(struct.pack("<2i", len(puffer_map.objects), len(puffer_map.roads)))
    for entity in (*puffer_map.objects, *puffer_map.roads):
        count = len(entity.position)
        parts.append(
            struct.pack("<2i", entity.kind, count)
            if layout == 1
            else struct.pack("<4i", 0, entity.kind, entity.id, count)
        )
        parts.append(entity.position.T.astype("<f4").tobytes())
        if entity.velocity is not None and entity.heading is not None and entity.valid is not None:
            parts += [entity.velocity.T.astype("<f4").tobytes(), entity.heading.astype("<f4").tobytes()]
            parts.append(entity.valid.astype("<i4").tobytes())
        parts.append(struct.pack("<6fi", *entity.size, *entity.goal, entity.is_expert))
    return b"".join(parts)


def decode(content: bytes, layout: int, file: str) -> PufferMap:
    """Read a map in layout 1 or 2.

    Raises:
        CorruptSource: The file is cut off, longer than its content, or in another layout.
    """
    reader = _Reader(content, file)
    ego, predicted = -1, tuple[int, ...]()
    if layout == 2:
        ego = reader.number()
        predicted = tuple(reader.number() for _ in range(reader.count("tracks to predict")))
    num_objects, num_roads = reader.count("objects"), reader.count("roads")
    entities = []
    for number in range(num_objects + num_roads):
        if layout == 2:
            reader.number()
        kind = reader.number()
        entity_id = reader.number() if layout == 2 else number
        is_object = number < num_objects
        if (kind in OBJECT_TYPES.values()) != is_object or not VEHICLE <= kind <= DRIVEWAY:
            raise reader.damaged(f"entity {number:,} has the type {kind}")
        count = reader.count(f"points of entity {number:,}")
        position = reader.floats(3 * count).reshape(3, count).T
        motion = reader.motion(count) if is_object else {}
        width, length, height, *goal = reader.floats(6).tolist()
        entities.append(
            Entity(
                kind, entity_id, position, size=(width, length, height), goal=(goal[0], goal[1], goal[2]),
                is_expert=bool(reader.number()), **motion,
            )
        )  # fmt: skip
    reader.check_end()
    return PufferMap(entities[:num_objects], entities[num_objects:], ego, predicted)


class _Reader:
    """Numbers from a position that moves through a file."""

    def __init__(self, content: bytes, file: str) -> None:
        self._content, self._file, self._at = content, file, 0

    def damaged(self, found: str) -> CorruptSource:
        return CorruptSource(
            f"{self._file}: at byte {self._at:,}: {found}; "
            "is it a map of this layout? copy it again, or give the other layout"
        )

    def number(self) -> int:
        return int(self.numbers(1)[0])

    def count(self, what: str) -> int:
        found = self.number()
        if not 0 <= found <= _LONGEST:
            raise self.damaged(f"expected a number of {what}, found {found:,}")
        return found

    def numbers(self, count: int) -> np.ndarray:
        return self._take(count, "<i4")

    def floats(self, count: int) -> np.ndarray:
        return self._take(count, "<f4")

    def motion(self, count: int) -> dict[str, Any]:
        """Velocities, headings and validity of an object."""
        velocity = self.floats(3 * count).reshape(3, count).T
        return {"velocity": velocity, "heading": self.floats(count), "valid": self.numbers(count) != 0}

    def _take(self, count: int, kind: str) -> np.ndarray:
        if self._at + 4 * count > len(self._content):
            raise self.damaged(f"expected {4 * count:,} more bytes, found {len(self._content) - self._at:,}")
        found = np.frombuffer(self._content, kind, count, self._at)
        self._at += 4 * count
        return found

    def check_end(self) -> None:
        if self._at != len(self._content):
            raise self.damaged(f"expected the end of the file, found {len(self._content) - self._at:,} more bytes")
