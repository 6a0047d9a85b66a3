"""Parameters of variations: what is changed, how its values are distributed, and values drawn from that.

A distribution is a text: ``0.8:1.2`` (uniform), ``0,1`` (one of these), ``10:50:5`` (one of 10, 15, ..., 50),
``1.5`` (always), the name of a continuous distribution of SciPy with its arguments, ``norm(0, 2)``, or
``quantiles(2, 5, 9)``, values at equal steps of probability with straight lines between them. All are drawn by
the inverse of their distribution function, from points of the unit cube: random ones, Sobol's or a Latin hypercube.
"""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np

from scenarionet_data.arrays.dtypes import Float64, is_count
from scenarionet_data.errors import BadParameter, MissingDependency
from scenarionet_data.scenario.settings import check_is

Method = Literal["random", "sobol", "latin"]
"""Points of the unit cube: independent, Sobol's sequence (scrambled), or a Latin hypercube."""

CHANGES = ("pace", "start", "delay", "speed", "gap", "offset", "drift", "size", "replace", "remove", "copy")
"""What can be changed of a road user, in the order in which changes are applied."""

LIGHTS, ROAD = "lights", "road"
"""Targets of the changes that are not of a road user: ``lights.start`` and ``road.friction``."""

FRICTION = "friction"
"""Change of the road: a factor on the grip of vehicles that are driven by actions; also the key in ``extras``."""

_CHANGES_OF = {LIGHTS: ("start",), ROAD: (FRICTION,)}

QUANTILES = "quantiles("
"""Beginning of a distribution that is given by its quantiles."""

_CALL = re.compile(r"(\w+)\(([^()]*)\)")
_EDGE = 1e-9  # unbounded distributions are infinite at 0 and 1


@dataclass(frozen=True)
class DistributedParameter:
    """A name and the distribution of its values, see the module."""

    name: str
    distribution: str

    def __post_init__(self) -> None:
        self.at(np.array([0.0, 0.5, 1.0]))

    def at(self, quantiles: Float64) -> Float64:
        """Return the values at quantiles (n,) in [0, 1].

        Raises:
            BadParameter: The distribution is none, is upside down, or gives NaN.
            MissingDependency: It needs SciPy.
        """
        text, inner = self.distribution.strip(), quantiles.clip(_EDGE, 1 - _EDGE)
        if text.startswith(QUANTILES) and (call := _CALL.fullmatch(text)):
            known = np.array(self._numbers(call[2], ","))
            if len(known) < 2 or (np.diff(known) < 0).any():
                raise BadParameter(f"{self.name}={text}: wanted two or more quantiles, none below the one before")
            values = np.asarray(np.interp(quantiles, np.linspace(0.0, 1.0, len(known)), known), np.float64)
        elif call := _CALL.fullmatch(text):
            values = np.asarray(_scipy_distribution(self.name, call[1])(*self._numbers(call[2], ",")).ppf(inner))
        elif (choices := self.choices) is not None:
            values = choices[(inner * len(choices)).astype(np.int64)]
        else:
            bounds = self._numbers(text, ":")
            if len(bounds) != 2 or bounds[0] > bounds[1]:
                raise BadParameter(f"{self.name}={text}: wanted LOW:HIGH with LOW at most HIGH")
            values = bounds[0] + (bounds[1] - bounds[0]) * quantiles
        if not np.isfinite(values).all():
            raise BadParameter(f"{self.name}={text} gives {values[~np.isfinite(values)][0]}; correct its arguments")
        return values

    @property
    def choices(self) -> Float64 | None:
        """The values (k,), if it has only some: ``1,2,5`` or, from low to high by steps, ``10:50:5``."""
        if _CALL.fullmatch(self.distribution.strip()):
            return None
        if ":" not in self.distribution:
            return np.array(self._numbers(self.distribution, ","))
        bounds = self._numbers(self.distribution, ":")
        if len(bounds) != 3:
            return None
        low, high, step = bounds
        if low > high or step <= 0:
            raise BadParameter(f"{self.name}={self.distribution}: wanted LOW:HIGH:STEP with LOW at most HIGH, STEP > 0")
        return np.asarray(low + step * np.arange(math.floor((high - low) / step + 1e-9) + 1), np.float64)

    def _numbers(self, text: str, separator: str) -> list[float]:
        try:
            numbers = [float(word) for word in text.split(separator)]
        except ValueError:
            numbers = [math.nan]
        if not all(map(math.isfinite, numbers)):
            raise BadParameter(
                f"{self.name}={self.distribution}: wanted LOW:HIGH, values A,B,C, or a distribution such as norm(0, 2)"
            )
        return numbers


@dataclass(frozen=True)
class VariedParameter(DistributedParameter):
    """A parameter of a variation: ``TARGET.CHANGE``.

    The target is ``ego``, ``nearest``, ``lights``, ``road``, a track's id, or of a moment ``actor`` or ``other``.
    """

    def __post_init__(self) -> None:
        if not self.target or self.change not in _CHANGES_OF.get(self.target, CHANGES):
            raise BadParameter(
                f"parameter {self.name!r}: wanted TARGET.CHANGE, with a target such as ego, nearest or a track, and "
                f"one of the changes {', '.join(CHANGES)}; or lights.start, road.friction"
            )
        if (self.target, self.change) == ("ego", "remove"):
            raise BadParameter("ego.remove: a scenario needs its ego; remove another road user")
        super().__post_init__()

    @property
    def target(self) -> str:
        """What is changed."""
        return self.name.rpartition(".")[0]

    @property
    def change(self) -> str:
        """How it is changed."""
        return self.name.rpartition(".")[2]

    def at(self, quantiles: Float64) -> Float64:
        """Return the values at quantiles, as :meth:`DistributedParameter.at`; of a factor they must be above 0."""
        values = super().at(quantiles)
        if self.change in ("speed", "pace", "size", FRICTION) and values.min() <= 0:
            text = self.distribution
            raise BadParameter(f"{self.name}={text} gives {values.min():.4g}; {self.change} is a factor above 0")
        if self.change == "replace" and (self.choices is None or not np.isin(values, range(5)).all()):
            text = self.distribution
            raise BadParameter(
                f"{self.name}={text}: wanted 0 (as it is), 1 (car), 2 (lorry), 3 (cyclist), 4 (pedestrian)"
            )
        return values


def _scipy_distribution(name: str, kind: str) -> Any:
    """Return a continuous distribution of SciPy by its name."""
    try:
        from scipy import stats
    except ModuleNotFoundError as error:
        raise MissingDependency(
            f"{name}: the distribution {kind} needs scipy", "vary", "or a range LOW:HIGH"
        ) from error
    found = getattr(stats, kind, None)
    if not isinstance(found, stats.rv_continuous):
        raise BadParameter(
            f"{name}: SciPy has no continuous distribution {kind!r}; norm, truncnorm, gamma, ... are some"
        )
    return found


def parse_parameters(given: Mapping[str, Any]) -> tuple[VariedParameter, ...]:
    """Return parameters from texts, numbers, or pairs (low, high), by name: as typed, in Python or in TOML.

    Raises:
        BadParameter: One of them is wrong, or there are none.
    """
    if not given or not isinstance(given, Mapping):
        raise BadParameter(f"parameters {given!r}: a variation changes something, for example ego.speed=0.8:1.2")
    for name in given:
        check_is("name", name, str, "a text such as 'ego.speed'")
    return tuple(VariedParameter(name, distribution_text(value)) for name, value in given.items())


def distribution_text(value: Any) -> str:
    """Return a distribution as text: a pair (low, high) is a range."""
    return ":".join(map(str, value)) if isinstance(value, list | tuple) else str(value)


def correlated(cube: Float64, correlation: Float64) -> Float64:
    """Return points (n, d) of the unit cube that depend on each other by a Gaussian copula.

    Args:
        cube: Independent, uniform points (n, d).
        correlation: Of their normal scores (d, d).

    Raises:
        MissingDependency: SciPy is not installed.
    """
    if (correlation == np.eye(len(correlation))).all():
        return cube
    try:
        from scipy.special import ndtr, ndtri
    except ModuleNotFoundError as error:
        raise MissingDependency("a table [correlation] needs scipy", "vary") from error
    root = np.linalg.cholesky(correlation + _EDGE * np.eye(len(correlation)))
    return np.asarray(ndtr(ndtri(cube.clip(_EDGE, 1 - _EDGE)) @ root.T))


def draw(
    parameters: Sequence[DistributedParameter],
    number: int,
    seed: int = 0,
    method: Method = "random",
    parent: str = "",
    correlation: Float64 | None = None,
) -> Float64:
    """Return values (number, parameters), the same for the same arguments.

    Except for a Latin hypercube, more values begin with those of a smaller number.

    Args:
        parameters: The parameters.
        number: Number of variations.
        seed: Seed.
        method: How the space is filled.
        parent: The scenario that is varied; others have other values.
        correlation: Of the parameters' normal scores (parameters, parameters); None for independent ones.

    Raises:
        BadParameter: The number, the seed or the method is wrong.
        MissingDependency: The method needs SciPy.
    """
    if not (is_count(number, 1) and is_count(seed)):
        raise BadParameter(f"number={number}, seed={seed}: wanted whole numbers, from 1 and from 0 on")
    if method not in get_args(Method):
        raise BadParameter(f"method {method!r}: wanted one of {', '.join(get_args(Method))}")
    digest = hashlib.blake2b(parent.encode(), digest_size=8).digest()
    rng = np.random.default_rng([seed, int.from_bytes(digest, "big")])
    if method == "random":
        cube = rng.random((number, len(parameters)))
    else:
        try:
            from scipy.stats import qmc
        except ModuleNotFoundError as error:
            raise MissingDependency(f"method {method} needs scipy", "vary", "or --method random") from error
        if method == "sobol":
            cube = qmc.Sobol(len(parameters), rng=rng).random_base2((number - 1).bit_length())[:number]
        else:
            cube = qmc.LatinHypercube(len(parameters), rng=rng).random(number)
    if correlation is not None:
        cube = correlated(cube, correlation)
    return np.stack([each.at(column) for each, column in zip(parameters, cube.T, strict=True)], axis=1)
