"""Variations that are drawn as they are needed: what varies, and one variation, or all, of a scenario."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

from scenarionet_data.errors import BadParameter, InvalidScenario
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.scenario.settings import check_settings
from scenarionet_data.variations.changes import change
from scenarionet_data.variations.limits import ACCELERATION, JERK, check_limits
from scenarionet_data.variations.moment_windows import ALL
from scenarionet_data.variations.parameters import Method, draw, parse_parameters

_TRIALS = 32
"""Values that are drawn instead of some that cannot be."""


@dataclass(frozen=True)
class VariationSpace:
    """What is varied, how often, and within which limits.

    Attributes:
        parameters: Distributions by name; see :func:`~scenarionet_data.variations.parameters.parse_parameters`.
        number: Variations of each scenario.
        seed, method: See :func:`~scenarionet_data.variations.parameters.draw`.
        acceleration, jerk: Limits of changed road users [m/s^2], [m/s^3].
        margin: Of moments, time that is kept before and after [s]; all by default.
    """

    parameters: Mapping[str, Any]
    number: int = 1000
    seed: int = 0
    method: Method = "random"
    acceleration: float = ACCELERATION
    jerk: float = JERK
    margin: float = ALL

    def __post_init__(self) -> None:
        check_settings(self)
        if not self.margin >= 0:
            raise BadParameter(f"margin={self.margin}: wanted seconds, 0 or more")
        parse_parameters(self.parameters)


def variations_of(
    parent: ScenarioDescription, space: VariationSpace
) -> Iterator[ScenarioDescription | InvalidScenario]:
    """Yield the variations of a scenario, or why one cannot be, without a lake: to simulate them as they are made.

    They have the values, and so the content, of those that ``vary`` stores, and ids ``PARENT@NUMBER``.

    Args:
        parent: The scenario.
        space: What is varied; ``margin`` is of moments and does nothing.
    """
    parameters = parse_parameters(space.parameters)
    for number, row in enumerate(draw(parameters, space.number, space.seed, space.method, parent.id).tolist()):
        try:
            yield _numbered(parent, row, space, number)
        except InvalidScenario as error:
            yield error


def variation_of(parent: ScenarioDescription, space: VariationSpace, number: int) -> ScenarioDescription:
    """Return the variation of a scenario with a number, below ``space.number``; in place of one that cannot be another.

    Raises:
        InvalidScenario: None of the others can be either; the reason is that of the last.
    """
    parameters = parse_parameters(space.parameters)
    (row,) = draw(parameters, space.number, space.seed, space.method, parent.id)[[number]].tolist()
    others = draw(parameters, _TRIALS, space.seed, "random", f"{parent.id}@{number}").tolist()
    for values in (row, *others[:-1]):
        try:
            return _numbered(parent, values, space, number)
        except InvalidScenario:
            continue
    return _numbered(parent, others[-1], space, number)


def _numbered(
    parent: ScenarioDescription, values: Sequence[float], space: VariationSpace, number: int
) -> ScenarioDescription:
    changed = varied(parent, dict(zip(space.parameters, values, strict=True)), {}, space)
    return replace(changed, id=f"{parent.id}@{number:06d}")


class _Limits(Protocol):
    @property
    def acceleration(self) -> float: ...
    @property
    def jerk(self) -> float: ...


def varied(
    parent: ScenarioDescription, values: Mapping[str, float], roles: Mapping[str, str], limits: _Limits
) -> ScenarioDescription:
    """Return a scenario with other values.

    Args:
        parent: The scenario.
        values: By name.
        roles: Tracks by other names that targets may have.
        limits: Largest acceleration and jerk of changed road users.

    Raises:
        InvalidScenario: It is not plausible.
    """
    changed, origins = change(parent, values, roles)
    check_limits(parent, changed, origins, limits.acceleration, limits.jerk)
    return replace(changed, extras={**changed.extras, "parent": parent.id, "parameters": dict(values)})
