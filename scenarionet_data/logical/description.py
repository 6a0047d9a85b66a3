"""The file of a logical scenario: its road, its road users, and how its parameters are distributed."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.errors import BadParameter
from scenarionet_data.logical.expressions import evaluate
from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_data.variations.parameters import DistributedParameter, distribution_text, draw

LIBRARY = Path(__file__).with_name("library")
"""Folder of the logical scenarios that are part of the package."""

SIZES = {
    ObjectType.VEHICLE: ("4.6", "1.8", "1.5"),
    ObjectType.PEDESTRIAN: ("0.6", "0.6", "1.75"),
    ObjectType.CYCLIST: ("1.8", "0.6", "1.7"),
}
"""Length, width and height [m] of road users whose size is not given."""


@dataclass(frozen=True)
class RoadSpec:
    """The road: a generated one, or a map.

    Attributes:
        kind: ``road``, or ``intersection`` of four roads at the end of the first.
        lanes, opposite: Number in each direction.
        width: Of a lane [m].
        length: Of each road [m].
        radius: Of the road [m], positive to the left; 0 is straight.
        speed_limit: [m/s].
        map: ``*.xodr``, ``*.geojson`` or ``*.osm`` with the lanes of the routes instead.
    """

    kind: str = "road"
    lanes: int = 2
    opposite: int = 1
    width: float = 3.5
    length: float = 600.0
    radius: float = 0.0
    speed_limit: float = 36.1
    map: str = ""


@dataclass(frozen=True)
class SpeedChange:
    """From ``start`` [s] on, the speed changes to ``to`` [m/s] by ``rate`` [m/s^2]: expressions."""

    start: str
    to: str
    rate: str


@dataclass(frozen=True)
class Sideways:
    """A move to the offset ``to`` [m]: expressions.

    Attributes:
        to: Offset from the route at its end, positive to the left.
        duration: Of a smooth move of least jerk [s]; else ``rate`` is the constant lateral speed [m/s].
        start: When it begins [s]; else it passes the offset ``passes`` [m] at the time ``at`` [s].
    """

    to: str
    duration: str = ""
    rate: str = ""
    start: str = ""
    passes: str = ""
    at: str = "0"


@dataclass(frozen=True)
class ActorSpec:
    """A road user; texts are expressions of the parameters.

    Attributes:
        id: Its track; the first one is ``ego``.
        type: ``VEHICLE``, ``PEDESTRIAN`` or ``CYCLIST``.
        size: Length, width, height [m].
        route: Ids of consecutive lanes; empty for the rightmost one of the road.
        across: Instead: straight across the first road user's route, so many metres along it; from the right.
        against: Drives in the other direction of its route.
        speed: At the start [m/s].
        offset: To the left of the route at the start [m].
        when: Time [s] at which one of the following holds.
        at: Distance of its centre along the route [m].
        gap: From bumper to bumper ahead of the road user ``of`` [m]; on the same route.
        after: Time from when the rear of ``of`` leaves the area that both sweep until its front enters it [s]; below
            0 it passes first. Independent of ``when``.
        meets: Time from when the centre of ``of`` is where the routes cross until its own is [s]. Likewise.
        of: Another road user, listed before.
        changes, moves: In the order of time.
    """

    id: str
    type: str = "VEHICLE"
    size: tuple[str, ...] = ()
    route: tuple[str, ...] = ()
    across: float | None = None
    against: bool = False
    speed: str = "0"
    offset: str = "0"
    when: str = "0"
    at: str = ""
    gap: str = ""
    after: str = ""
    meets: str = ""
    of: str = "ego"
    changes: tuple[SpeedChange, ...] = ()
    moves: tuple[Sideways, ...] = ()

    @property
    def object_type(self) -> ObjectType:
        """Its type."""
        return ObjectType[self.type]


@dataclass(frozen=True)
class LogicalScenario:
    """A logical scenario.

    Attributes:
        name: Name of the file.
        text: The file.
        duration, dt: Of each scenario and of its timesteps [s].
        road: The road.
        parameters: What differs between concrete scenarios.
        values: Further names of the expressions, computed in this order.
        actors: The road users, the ego first.
        correlation: How parameters depend on each other, by a Gaussian copula: correlation of the normal scores of two
            of them, ``"ego_speed, gap"``.
    """

    name: str
    text: str
    parameters: tuple[DistributedParameter, ...]
    actors: tuple[ActorSpec, ...]
    road: RoadSpec = field(default_factory=RoadSpec)
    values: Mapping[str, str] = field(default_factory=dict)
    duration: float = 10.0
    dt: float = 0.1
    correlation: Mapping[str, str] = field(default_factory=dict)

    @cached_property
    def time(self) -> Float64:
        """(T,) timestamps [s]."""
        return np.asarray(np.arange(round(self.duration / self.dt) + 1) * self.dt, np.float64)

    def correlations(self, names: Sequence[str]) -> Float64:
        """Return the correlation of the normal scores of some parameters (d, d).

        Raises:
            BadParameter: A pair has a name that is no parameter, or a value that cannot be.
        """
        found, known = np.eye(len(names)), [each.name for each in self.parameters]
        for pair, text in self.correlation.items():
            both = [each.strip() for each in pair.split(",")]
            try:
                value = float(text)
            except ValueError:
                value = np.nan
            if len(set(both)) != 2 or not set(both) <= set(known) or not abs(value) <= 1:
                raise BadParameter(
                    f'{self.name}: correlation "{pair}" = {text}; wanted two of {", ".join(known)}, and -1 to 1'
                )
            if set(both) <= set(names):
                row, column = map(names.index, both)
                found[row, column] = found[column, row] = value
        if np.linalg.eigvalsh(found).min() < -1e-6:
            raise BadParameter(f"{self.name}: correlations {dict(self.correlation)} contradict each other")
        return found

    def draw(self, number: int, seed: int = 0, method: str = "random") -> Float64:
        """Return the parameters (n, P) of concrete scenarios; ``grid`` is every combination of their values.

        Raises:
            BadParameter: As :func:`~scenarionet_data.variations.parameters.draw`, or a grid of a parameter that has
                not only some values.
        """
        if method != "grid":
            dependence = self.correlations([each.name for each in self.parameters])
            return draw(self.parameters, number, seed, method, self.name, dependence)  # type: ignore[arg-type]
        axes = [each.choices for each in self.parameters]
        for each, values in zip(self.parameters, axes, strict=True):
            if values is None:
                raise BadParameter(f"{each.name}={each.distribution}: a grid wanted values A,B,C or LOW:HIGH:STEP")
        return np.array(list(product(*(values for values in axes if values is not None))))

    def named(self, rows: Float64) -> dict[str, Float64]:
        """Return all names (B,) of the expressions from parameters (B, P).

        Raises:
            BadParameter: An expression is wrong.
        """
        found = {each.name: column for each, column in zip(self.parameters, rows.T, strict=True)}
        for name, text in self.values.items():
            found[name] = np.broadcast_to(evaluate(text, found), (len(rows),))
        return found


def read_logical(source: str | Path) -> LogicalScenario:
    """Read the file of a logical scenario, or one of the library by its name.

    Raises:
        BadParameter: There is none, or it is wrong.
    """
    path = Path(source)
    if path.suffix != ".toml":
        path = LIBRARY / f"{source}.toml"
        if not path.is_file():
            known = ", ".join(sorted(each.stem for each in LIBRARY.glob("*.toml")))
            raise BadParameter(f"{source}: no logical scenario; give a file *.toml or one of {known}")
    try:
        text = path.read_text("utf-8")
    except (OSError, ValueError) as error:
        raise BadParameter(f"{path}: cannot be read ({error})") from error
    return parse_logical(text, path.stem)


def parse_logical(text: str, name: str) -> LogicalScenario:
    """Return the logical scenario of a file's text; errors as :func:`read_logical`."""
    try:
        found = tomllib.loads(text)
    except ValueError as error:
        raise BadParameter(f"{name}: {error}; wanted a TOML file with parameters and actors") from error
    actors = found.pop("actors", [])
    if not isinstance(actors, list) or not actors:
        raise BadParameter(f"{name}: wanted tables [[actors]], the first of them the ego; found none")
    found["actors"] = tuple(_record(ActorSpec, each, f"{name}: actor {k}") for k, each in enumerate(actors))
    found["road"] = _record(RoadSpec, found.get("road", {}), f"{name}: road")
    given = found.get("parameters", {})
    found["parameters"] = tuple(DistributedParameter(key, distribution_text(value)) for key, value in given.items())
    if not found["parameters"]:
        raise BadParameter(f"{name}: wanted a table [parameters], for example speed = [10, 20]")
    logical = _record(LogicalScenario, found | {"name": name, "text": text}, name)
    _check(logical)
    return logical


def _check(logical: LogicalScenario) -> None:
    """Refuse road users that cannot be placed, and correlations that cannot be."""
    seen: list[str] = []
    logical.correlations([each.name for each in logical.parameters])
    if not 0 < logical.dt <= logical.duration < np.inf:
        raise BadParameter(
            f"{logical.name}: duration={logical.duration:g}, dt={logical.dt:g}; wanted 0 < dt <= duration"
        )
    if logical.road.kind not in ("road", "intersection"):
        raise BadParameter(f"{logical.name}: road.kind={logical.road.kind!r}; wanted road or intersection")
    for actor in logical.actors:
        place = f"{logical.name}: actor {actor.id!r}"
        if actor.type not in {each.name for each in SIZES}:
            raise BadParameter(f"{place}: type={actor.type!r}; wanted {', '.join(each.name for each in SIZES)}")
        if sum(bool(text) for text in (actor.at, actor.gap, actor.after, actor.meets)) != 1:
            raise BadParameter(f"{place}: wanted one of at, gap, after and meets, which says where it is")
        if (actor.gap or actor.after or actor.meets) and actor.of not in seen:
            raise BadParameter(
                f"{place}: of={actor.of!r}; wanted a road user listed before: {', '.join(seen) or 'none'}"
            )
        if actor.id in seen or len(actor.size) not in (0, 3):
            raise BadParameter(f"{place}: wanted an id of its own, and a size of length, width, height")
        for move in actor.moves:
            if bool(move.duration) == bool(move.rate) or bool(move.start) == bool(move.passes):
                raise BadParameter(f"{place}: a move wanted duration or rate, and start or passes")
        seen.append(actor.id)
    if seen[0] != "ego":
        raise BadParameter(f"{logical.name}: the first road user is {seen[0]!r}; wanted 'ego'")


Spec = TypeVar("Spec")


def _record(kind: type[Spec], given: Any, place: str) -> Spec:
    """Make a dataclass from a table of TOML: numbers become texts where expressions are wanted."""
    known = {each.name: str(each.type) for each in fields(kind)}  # type: ignore[arg-type]
    wrong = sorted(set(given) - set(known)) if isinstance(given, dict) else [given]
    if wrong:
        raise BadParameter(f"{place}: {wrong[0]!r} is unknown; wanted {', '.join(known)}")
    values = {}
    for name, value in given.items():
        wanted = known[name]
        if wanted.startswith(("tuple[SpeedChange", "tuple[Sideways")):
            part = SpeedChange if "SpeedChange" in wanted else Sideways
            value = tuple(_record(part, each, f"{place}: {name}") for each in value)
        elif wanted == "tuple[str, ...]":
            value = tuple(map(str, value))
        elif wanted == "str" and isinstance(value, int | float):
            value = str(value)
        elif wanted in ("float", "int", "bool") and type(value) not in (
            (int, float) if wanted == "float" else (int, bool)
        ):
            raise BadParameter(f"{place}: {name}={value!r}; wanted {wanted}")
        elif wanted.startswith("Mapping"):
            value = {key: str(text) for key, text in value.items()}
        values[name] = value
    try:
        return kind(**values)
    except TypeError as error:
        raise BadParameter(f"{place}: {error}") from error
