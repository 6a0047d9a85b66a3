"""Drivers and traffic of an evaluation, by name.

A driver of your own is a class named as ``module:Class``: a ``Policy``, which has access to everything and drives the
ego, or a class with a method ``act`` that maps an observation to an action.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass, replace
from typing import Any, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from scenarionet_data.errors import BadParameter
from scenarionet_data.storage.files.opening import open_files
from scenarionet_sim.backends.base import Backend
from scenarionet_sim.backends.bullet import Bullet
from scenarionet_sim.backends.kinematic import Kinematic
from scenarionet_sim.learning.driver import PREFIX, load_driver
from scenarionet_sim.policies import (
    ConstantVelocity,
    External,
    Idm,
    NoisyVelocity,
    Policy,
    Replay,
    SampledIdm,
    ego,
)
from scenarionet_sim.sensors import EgoState

BACKENDS: dict[str, Backend] = {"kinematic": Kinematic(), "bullet": Bullet()}
DRIVERS: dict[str, Policy] = {
    "replay": Replay(objects=ego),
    "idm": Idm(objects=ego),
    "idm-sampled": SampledIdm(objects=ego),
    "constant": ConstantVelocity(objects=ego),
    "constant-noisy": NoisyVelocity(objects=ego),
}
RANDOM = "random"
"""Name of the driver :class:`RandomActions`."""

TRAFFIC: dict[str, tuple[Policy, ...]] = {
    "replay": (Replay(),),
    "idm": (Replay(), Idm()),
    "idm-sampled": (Replay(), SampledIdm()),
    "constant": (ConstantVelocity(),),
    "constant-noisy": (NoisyVelocity(),),
}
REACTIVE = ("idm", "idm-sampled")
"""Traffic that reacts to the ego."""


@runtime_checkable
class Driver(Protocol):
    """Drives from observations; constructed without arguments, once per batch of scenarios.

    Optional members: ``sensors``, a tuple of sensors (default: the paper's observation), ``reset()``, called
    before each scenario, and after it ``seed(rng)``, with the random numbers of the rollout.
    """

    def act(self, observation: Any) -> npt.ArrayLike:
        """Return steering and throttle in [-1, 1] for a flat observation of the ego (D,) float32."""
        ...


class RandomActions:
    """Uniformly random steering and throttle: a floor for drivers."""

    sensors = (EgoState(),)

    def __init__(self) -> None:
        self.seed(np.random.default_rng(0))

    def seed(self, rng: np.random.Generator) -> None:
        """Draw actions from these random numbers."""
        self._rng = rng

    def act(self, observation: Any) -> npt.ArrayLike:
        """Return random actions."""
        del observation
        return self._rng.uniform(-1.0, 1.0, 2)


@dataclass(frozen=True)
class Drivers:
    """Resolved drivers of ego and traffic.

    Attributes:
        policies: Policies of the simulation.
        driver: Computes the ego's actions; None when a policy drives the ego.
    """

    policies: tuple[Policy, ...]
    driver: Driver | None


def resolve_drivers(policy: str, traffic: str = "replay", lake: str | None = None) -> Drivers:
    """Return the drivers of ego and traffic.

    Args:
        policy: A name in DRIVERS, ``module:Class``, or ``runs/NAME`` of a training run.
        traffic: A name in TRAFFIC.
        lake: The lake that has the training run.

    Raises:
        BadParameter: A name is unknown, or the class is neither a policy nor a driver.
    """
    others = _lookup(TRAFFIC, traffic, "traffic")
    if lake is not None and policy.startswith(PREFIX):
        return Drivers((*others, External()), load_driver(open_files(lake), policy))
    if policy == RANDOM:
        return Drivers((*others, External()), RandomActions())
    if ":" not in policy:
        return Drivers((*others, _lookup(DRIVERS, policy, "policy")), None)
    module, _, name = policy.partition(":")
    try:
        made = getattr(importlib.import_module(module), name)()
    except (ImportError, AttributeError) as error:
        raise BadParameter(f"policy {policy}: {error}; is its folder on PYTHONPATH?") from error
    if isinstance(made, Policy):
        return Drivers((*others, replace(made, objects=ego)), None)
    if isinstance(made, Driver):
        return Drivers((*others, External()), made)
    raise BadParameter(f"{policy} is not a driver: expected a subclass of Policy, or a class with act(observation)")


def find_backend(name: str) -> Backend:
    """Return a backend by name.

    Raises:
        BadParameter: The name is unknown.
    """
    backend: Backend = _lookup(BACKENDS, name, "backend")
    return backend


def _lookup(choices: dict[str, Any], name: str, kind: str) -> Any:
    if name not in choices:
        own = ", runs/NAME of a training run, or module:Class for your own" if kind == "policy" else ""
        names = [*choices, RANDOM] if kind == "policy" else choices
        raise BadParameter(f"unknown {kind} {name!r}; choose from {', '.join(names)}{own}")
    return choices[name]
