"""What a sample contains: frozen choices of time, agents, map, targets, perspective and augmentation."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field
from typing import Any, Literal, TypeVar

import numpy as np

from scenarionet_data.arrays.dtypes import is_count, is_number
from scenarionet_data.errors import BadParameter
from scenarionet_data.query.statements import check_expression
from scenarionet_data.scenario.vocabulary import ObjectType

ROAD_USERS = (ObjectType.VEHICLE, ObjectType.PEDESTRIAN, ObjectType.CYCLIST)


@dataclass(frozen=True)
class TimeWindow:
    """The time of a sample, on the same timesteps for every dataset.

    Attributes:
        history: Time before the current timestep [s].
        future: Time after it [s].
        dt: Timestep [s]; recordings with another one are interpolated, angles along the shorter arc.
        stride: Time between the current timesteps of a scenario's samples [s], from the first that has the whole
            history; by default a scenario is used once, at its own ``current_timestep`` or, where that leaves no room
            for the window, at the first timestep that does.
        longest_gap: Longest time between two recorded states that is interpolated [s].
    """

    history: float = 1.0
    future: float = 8.0
    dt: float = 0.1
    stride: float | None = None
    longest_gap: float = 1.0

    def __post_init__(self) -> None:
        _require_numbers(self, "history", "future", "dt", "longest_gap")
        _require(0 < self.dt < np.inf, "dt", "a timestep above 0 s", self.dt)
        if self.stride is not None:
            _require_numbers(self, "stride")
        _require(self.stride is None or 0 < self.stride < np.inf, "stride", "a time above 0 s, or None", self.stride)
        _require(self.longest_gap >= 0, "longest_gap", "0 s or more", self.longest_gap)
        for name in ("history", "future"):
            steps = getattr(self, name) / self.dt
            is_whole = 0 <= steps < np.inf and abs(steps - round(steps)) < 1e-6
            _require(is_whole, name, f"a multiple of {self.dt:g} s", getattr(self, name))

    @property
    def num_history(self) -> int:
        """Timesteps of the history, with the current one."""
        return round(self.history / self.dt) + 1

    @property
    def num_future(self) -> int:
        """Timesteps of the future."""
        return round(self.future / self.dt)


@dataclass(frozen=True)
class Agents:
    """The objects of a sample: targets first, then others by distance at the current timestep.

    Attributes:
        count: Number of objects; missing ones are masked.
        radius: Largest distance of an object from the centre [m].
        types: Types of objects.
    """

    count: int = 64
    radius: float = 100.0
    types: tuple[ObjectType, ...] = ROAD_USERS

    def __post_init__(self) -> None:
        _require(is_count(self.count, 1), "count", "at least 1 agent", self.count)
        _require_numbers(self, "radius")
        _require(self.radius > 0, "radius", "a distance above 0 m", self.radius)
        kinds = ", ".join(kind.name for kind in ObjectType)
        is_several = isinstance(self.types, Collection) and len(self.types) > 0
        _require(is_several, "types", "a tuple of ObjectTypes", self.types)
        _require(all(isinstance(kind, ObjectType) for kind in self.types), "types", f"ObjectTypes: {kinds}", self.types)


@dataclass(frozen=True)
class Polylines:
    """The map of a sample: its features as polylines of equally spaced points, by distance from the centre.

    Attributes:
        count: Number of polylines; missing ones are masked. 0 for samples without a map.
        points: Points of a polyline; longer features become several polylines.
        spacing: Distance between points along the feature [m].
        radius: Largest distance of a polyline from the centre [m].
    """

    count: int = 256
    points: int = 20
    spacing: float = 1.0
    radius: float = 100.0

    def __post_init__(self) -> None:
        _require(is_count(self.count, 0), "count", "0 polylines or more", self.count)
        _require(is_count(self.points, 2), "points", "at least 2 points", self.points)
        _require_numbers(self, "spacing", "radius")
        _require(0 < self.spacing < np.inf, "spacing", "a distance above 0 m", self.spacing)
        _require(self.radius > 0, "radius", "a distance above 0 m", self.radius)


@dataclass(frozen=True)
class Targets:
    """The objects whose future is to be predicted.

    Attributes:
        which: ``recorded``: those that the dataset's challenge asks for (``tracks_to_predict``); ``ego``; ``moving``:
            road users that travel more than 1 m; ``where``: those of an SQL condition over the view ``objects``;
            ``default``: as ``recorded``, but ``moving`` in scenarios that name none.
        where: The condition, for example ``object_type = 'CYCLIST' AND distance > 5``.
        limit: Largest number of targets of a scenario; the first ones by ``track_index``.
    """

    which: Literal["default", "recorded", "ego", "moving", "where"] = "default"
    where: str = ""
    limit: int | None = None

    def __post_init__(self) -> None:
        kinds = ("default", "recorded", "ego", "moving", "where")
        _require(isinstance(self.which, str) and self.which in kinds, "which", " or ".join(kinds), self.which)
        _require(self.limit is None or is_count(self.limit, 1), "limit", "at least 1 target, or None", self.limit)
        _require(isinstance(self.where, str), "where", "SQL as text", self.where)
        has_condition = bool(self.where.strip())
        _require(
            has_condition == (self.which == "where"), "where", 'a condition exactly with which="where"', self.where
        )
        if has_condition:
            check_expression(self.where)

    @property
    def condition(self) -> str:
        """SQL over the view ``objects``; empty if targets are named in the view ``metadata``."""
        types = ", ".join(f"'{kind.name}'" for kind in ROAD_USERS)
        return f"distance > 1 AND object_type IN ({types})" if self.which in ("default", "moving") else self.where


@dataclass(frozen=True)
class Augmentation:
    """Random changes of samples, the same for the same seed, epoch and sample, in any worker and batch.

    Attributes:
        rotation: Largest angle by which a sample is turned [rad].
        flip: Probability of mirroring it at the x axis.
        noise: Standard deviation added to positions of the history [m].
        drop: Probability of leaving an agent out that is no target.
        seed: Seed of the draws.
    """

    rotation: float = 0.0
    flip: float = 0.0
    noise: float = 0.0
    drop: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        _require_numbers(self, "rotation", "flip", "noise", "drop")
        _require(0 <= self.rotation <= np.pi, "rotation", "0 ... pi rad", self.rotation)
        _require(0 <= self.noise < np.inf, "noise", "0 m or more", self.noise)
        _require(is_count(self.seed, 0), "seed", "a whole number of 0 or more", self.seed)
        for name in ("flip", "drop"):
            _require(0 <= getattr(self, name) <= 1, name, "a probability", getattr(self, name))


@dataclass(frozen=True)
class Choices:
    """Everything that determines a sample.

    Attributes:
        window, agents, polylines, targets, augmentation: The parts.
        perspective: ``agent``: one sample per target, with the target in the origin, heading along +x; ``scene``: one
            sample per scenario, with the ego in the origin.
    """

    window: TimeWindow = field(default_factory=TimeWindow)
    agents: Agents = field(default_factory=Agents)
    polylines: Polylines = field(default_factory=Polylines)
    targets: Targets = field(default_factory=Targets)
    augmentation: Augmentation = field(default_factory=Augmentation)
    perspective: Literal["agent", "scene"] = "agent"

    def __post_init__(self) -> None:
        is_known = isinstance(self.perspective, str) and self.perspective in ("agent", "scene")
        _require(is_known, "perspective", "agent or scene", self.perspective)


_Part = TypeVar("_Part", TimeWindow, Agents, Polylines, Targets, Augmentation)


def part_of(kind: type[_Part], name: str, given: Any) -> _Part:
    """Return a part of the choices: as given, or from the text or numbers of its first fields; the default for None.

    Raises:
        BadParameter: It is something else.
    """
    if given is None or isinstance(given, kind):
        return given or kind()
    is_text = kind is Targets and isinstance(given, str)
    if not (is_text or isinstance(given, tuple)):
        raise BadParameter(f"{name}: expected {kind.__name__}, such as {kind()!r}, found {given!r}")
    try:
        return kind(*((given,) if isinstance(given, str) else given))
    except TypeError as error:
        raise BadParameter(f"{name}: expected {kind.__name__}, such as {kind()!r}, found {given!r}") from error


def _require_numbers(choices: object, *names: str) -> None:
    for name in names:
        value = getattr(choices, name)
        _require(is_number(value), name, "a number", value)


def _require(is_right: bool, name: str, wanted: str, found: object) -> None:
    if not is_right:
        raise BadParameter(f"{name}: expected {wanted}, found {found!r}")
