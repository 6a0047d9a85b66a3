"""The parts of a scenario: ids, tracks, traffic lights, map features and source.

Frames, units and shapes are those of :mod:`scenarionet_data.scenario.description`.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any, Protocol, Self, cast
from urllib.parse import quote

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Bool, Float32, Int8, Object, UInt8, is_count
from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.errors import BadParameter
from scenarionet_data.scenario.vocabulary import MapFeatureType

_SCENARIO_ID = re.compile(r"[A-Za-z0-9._%-]+/[A-Za-z0-9._%-]+/[A-Za-z0-9._%@-]+")


def make_scenario_id(dataset: str, version: str, source_id: str, start: str | int | None = None) -> str:
    """Return the globally unique id ``<dataset>/<version>/<source id>[@start]``.

    Args:
        dataset: For example ``"waymo"``.
        version: The dataset's release, for example ``"v1.2"``.
        source_id: The scenario's (or log's) id in the source.
        start: Distinguishes windows of one log, for example by a timestamp.

    Example:
        >>> make_scenario_id("argoverse2", "v2", "log 7", 315966)
        'argoverse2/v2/log%207@315966'
    """
    for part in (dataset, version, source_id, "" if isinstance(start, int | None) else start):
        if not isinstance(part, str):
            raise BadParameter(f"{part!r} in an id; expected texts, and as start a text, a whole number, or None")
    parts = "/".join(quote(part, safe="").replace("~", "%7E") for part in (dataset, version, source_id))
    return parts if start is None else f"{parts}@{quote(str(start), safe='')}"


def is_scenario_id(text: str) -> bool:
    """Whether ``text`` has the form :func:`make_scenario_id` gives."""
    return _SCENARIO_ID.fullmatch(text) is not None


def strings(values: Any) -> Object:
    """Return an object array of str, the form of ids in every part of a scenario."""
    return np.array(list(map(str, values)), dtype=object)


class Unread(Protocol):
    """Values of fields, which are made when they are first read."""

    def __getitem__(self, field: str) -> Any: ...


class ScenarioPart:
    """Base of a scenario and its parts: values that take many Python objects may be made when they are first read."""

    if not TYPE_CHECKING:  # type checkers know the fields

        def __getattr__(self, name: str) -> Any:
            unread: Unread | None = self.__dict__.get("_unread")
            if unread is None or name not in self.__dataclass_fields__:
                raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
            return self.__dict__.setdefault(name, unread[name])  # the same for all threads

    def __getstate__(self) -> dict[str, Any]:
        return {each.name: getattr(self, each.name) for each in fields(cast(Any, self))}

    @classmethod
    def read(cls, values: Mapping[str, Any], unread: Unread) -> Self:
        """An instance whose fields are all in ``values`` or ``unread``."""
        part = object.__new__(cls)
        part.__dict__.update(values)
        part.__dict__["_unread"] = unread
        return part


_NOT_GIVEN: Bool = np.zeros((0, 0), np.bool_)


@dataclass(frozen=True, eq=False, repr=False)
class Tracks(ScenarioPart):
    """The objects of a scenario.

    Attributes:
        ids: (N,) str, unique.
        object_type: (N,) uint8 codes of ``ObjectType``.
        position: (N, T, 3) float32 [m] centre of the box.
        heading: (N, T) float32 [rad] in [-pi, pi).
        velocity: (N, T, 2) float32 [m/s] along the scenario frame's axes.
        size: (N, T, 3) float32 [m] length, width, height.
        valid: (N, T) bool; everything above is 0 where it is False.
        source_type: (N,) type as the source names it, or None.
        is_size_assumed, is_type_assumed, is_velocity_estimated: (N,) bool.
        extras: (N,) JSON text or None.
        is_interpolated: (N, T) bool: states between the recorded times, not recorded themselves; False by default.
    """

    ids: Object
    object_type: UInt8
    position: Float32
    heading: Float32
    velocity: Float32
    size: Float32
    valid: Bool
    source_type: Object
    is_size_assumed: Bool
    is_type_assumed: Bool
    is_velocity_estimated: Bool
    extras: Object
    is_interpolated: Bool = field(default_factory=lambda: _NOT_GIVEN)

    def __post_init__(self) -> None:
        if self.is_interpolated is _NOT_GIVEN:
            object.__setattr__(self, "is_interpolated", np.zeros_like(self.valid))

    def __len__(self) -> int:
        return len(self.object_type)

    def __repr__(self) -> str:
        return f"Tracks({len(self)} objects, {self.valid.shape[1]} timesteps)"

    def take(self, rows: Any) -> Tracks:
        """Return the objects at ``rows``, in that order."""
        return Tracks(**{name: getattr(self, name)[rows] for name in self.__dataclass_fields__})

    def index(self, track_id: str) -> int:
        """Return the row of a track; raise KeyError if the scenario has no such track."""
        (rows,) = np.nonzero(self.ids == track_id)
        if not len(rows):
            raise KeyError(f"no track {track_id!r}; there are {len(self)}, for example {list(self.ids[:3])}")
        return int(rows[0])


@dataclass(frozen=True, eq=False, repr=False)
class Lights(ScenarioPart):
    """Traffic lights, one row per lane they control.

    Attributes:
        ids: (L,) str; the lane's id where the source names no lights.
        lane_ids: (L,) str.
        stop_point: (L, 3) float32 [m], NaN where unknown.
        state: (L, T) uint8 codes of ``LightState``.
        is_lane_in_map: (L,) bool.
        provenance: (L,) uint8 codes of ``Provenance``.
    """

    ids: Object
    lane_ids: Object
    stop_point: Float32
    state: UInt8
    is_lane_in_map: Bool
    provenance: UInt8

    def __len__(self) -> int:
        return len(self.provenance)

    def __repr__(self) -> str:
        return f"Lights({len(self)} lights, {self.state.shape[1]} timesteps)"

    @classmethod
    def empty(cls, num_timesteps: int) -> Lights:
        """No lights over ``num_timesteps`` timesteps."""
        if not is_count(num_timesteps):
            raise BadParameter(f"num_timesteps={num_timesteps!r}; expected a whole number of 0 or more")
        none = np.zeros(0, dtype=object)
        codes = np.zeros(0, np.uint8)
        return cls(
            ids=none,
            lane_ids=none,
            stop_point=np.zeros((0, 3), np.float32),
            state=np.zeros((0, num_timesteps), np.uint8),
            is_lane_in_map=np.zeros(0, np.bool_),
            provenance=codes,
        )


ID_LISTS = (
    "entry_lanes",
    "exit_lanes",
    "left_neighbors",
    "right_neighbors",
    "left_boundaries",
    "right_boundaries",
    "controlled_lanes",
)
"""The fields of :class:`MapFeatures` that are lists of ids."""


@dataclass(frozen=True, eq=False, repr=False)
class MapFeatures(ScenarioPart):
    """Lanes, lines, edges and areas.

    Attributes:
        ids: (M,) str, unique.
        feature_type: (M,) uint8 codes of ``MapFeatureType``.
        polyline: M x (n, 3) float32 [m]: a lane's centreline in driving direction, a line, an edge,
            a stop sign's one point.
        polygon: M x (n, 3) float32 [m]: outline, implicitly closed; empty if the feature has none.
        speed_limit: (M,) float32 [m/s], NaN when unknown.
        width: M x (k, 2) float32 [m]: centreline to left and right side; k is 1, the number of points,
            or 0 when unknown.
        entry_lanes, exit_lanes: M x ids of predecessors and successors; ids outside the map are kept.
        left_neighbors, right_neighbors: M x ids of adjacent lanes.
        left_boundaries, right_boundaries: M x ids of lines and edges that bound a lane.
        controlled_lanes: M x ids of lanes a stop sign, stop line or crosswalk applies to.
        is_intersection: (M,) int8: 1 yes, 0 no, -1 unknown.
        extras: (M,) JSON text or None.
    """

    ids: Object
    feature_type: UInt8
    polyline: Ragged
    polygon: Ragged
    speed_limit: Float32
    width: Ragged
    entry_lanes: Ragged
    exit_lanes: Ragged
    left_neighbors: Ragged
    right_neighbors: Ragged
    left_boundaries: Ragged
    right_boundaries: Ragged
    controlled_lanes: Ragged
    is_intersection: Int8
    extras: Object

    def __len__(self) -> int:
        return len(self.feature_type)

    def __repr__(self) -> str:
        counts = np.bincount(self.feature_type)
        words = [f", {counts[kind]:,} {kind.name}" for kind in MapFeatureType if kind < len(counts) and counts[kind]]
        return f"MapFeatures({len(self):,} features{''.join(words)})"

    @property
    def types(self) -> UInt8:
        """Deprecated name of ``feature_type``."""
        warnings.warn("MapFeatures.types is now feature_type", DeprecationWarning, stacklevel=2)
        return self.feature_type

    @classmethod
    def empty(cls) -> MapFeatures:
        """A map without features."""
        none = np.zeros(0, dtype=object)
        return cls(
            ids=none,
            feature_type=np.zeros(0, np.uint8),
            polyline=Ragged.empty(0, 3),
            polygon=Ragged.empty(0, 3),
            speed_limit=np.zeros(0, np.float32),
            width=Ragged.empty(0, 2),
            is_intersection=np.zeros(0, np.int8),
            extras=none,
            **{name: Ragged.empty(0) for name in ID_LISTS},
        )

    def take(self, rows: Array) -> MapFeatures:
        """Return the features at ``rows``, in that order."""
        taken: dict[str, Any] = {}
        for column in fields(self):
            values = getattr(self, column.name)
            taken[column.name] = values.take(rows) if isinstance(values, Ragged) else values[rows]
        return MapFeatures(**taken)


@dataclass(frozen=True)
class Source:
    """Origin of a scenario.

    Attributes:
        scenario_id: Its id in the source.
        file: Raw file, relative to the raw folder.
        licence: Licence under which it may be used.
        log: Recording it was cut from; a split must not put scenarios of one log on both sides.
        city: Place, as the source names it.
        date: ISO 8601.
        crs: Name of the source frame.
    """

    scenario_id: str
    file: str
    licence: str
    log: str | None = None
    city: str | None = None
    date: str | None = None
    crs: str | None = None
