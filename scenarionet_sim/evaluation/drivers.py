"""Who drives in an evaluation: drivers and traffic by the names that a person types.

A driver of your own is a class, named ``module:Class``: a ``Policy``, which sees everything and is given the ego, or
a class with a method ``act`` that makes an action of an observation.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass, replace
from typing import Any, Protocol, runtime_checkable

import numpy.typing as npt

from scenarionet_data.errors import BadParameter
from scenarionet_sim.backends.base import Backend
from scenarionet_sim.backends.bullet import Bullet
from scenarionet_sim.backends.kinematic import Kinematic
from scenarionet_sim.policies import ConstantVelocity, External, Idm, Policy, Replay, ego

BACKENDS: dict[str, Backend] = {"kinematic": Kinematic(), "bullet": Bullet()}
DRIVERS: dict[str, Policy] = {
    "replay": Replay(who=ego),
    "idm": Idm(who=ego),
    "constant": ConstantVelocity(who=ego),
}
TRAFFIC: dict[str, tuple[Policy, ...]] = {"replay": (Replay(),), "idm": (Replay(), Idm())}


@runtime_checkable
class Driver(Protocol):
    """Drives by what it observes; made without arguments, once for a batch of scenarios.

    It may have an attribute ``sensors``, a tuple of what it observes (else it is the paper's), and a method
    ``reset()``, called before each scenario.
    """

    def act(self, observation: Any) -> npt.ArrayLike:
        """Steering and throttle in [-1, 1] from the flat observation of the ego (D,) float32."""
        ...


@dataclass(frozen=True)
class Cast:
    """Who drives.

    Attributes:
        policies: For a simulation.
        driver: Makes the ego's actions; None when a policy drives it.
    """

    policies: tuple[Policy, ...]
    driver: Driver | None


def cast(policy: str, traffic: str = "replay") -> Cast:
    """Who drives the ego and the others.

    Args:
        policy: A name in DRIVERS, or ``module:Class``.
        traffic: A name in TRAFFIC.

    Raises:
        BadParameter: There is none of that name, or the class is no driver.
    """
    others = _named(TRAFFIC, traffic, "traffic")
    if ":" not in policy:
        return Cast((*others, _named(DRIVERS, policy, "policy")), None)
    made = _made(policy)
    if isinstance(made, Policy):
        return Cast((*others, replace(made, who=ego)), None)
    if isinstance(made, Driver):
        return Cast((*others, External()), made)
    raise BadParameter(f"{policy} is no driver: wanted a subclass of Policy, or a class with a method act(observation)")


def find_backend(name: str) -> Backend:
    """A backend by name.

    Raises:
        BadParameter: There is none of that name.
    """
    backend: Backend = _named(BACKENDS, name, "backend")
    return backend


def _named(choices: dict[str, Any], name: str, what: str) -> Any:
    if name not in choices:
        own = ", or module:Class for one of your own" if what == "policy" else ""
        raise BadParameter(f"no {what} {name!r}; there are {', '.join(choices)}{own}")
    return choices[name]


def _made(text: str) -> Any:
    module, _, name = text.partition(":")
    try:
        return getattr(importlib.import_module(module), name)()
    except (ImportError, AttributeError) as error:
        raise BadParameter(f"policy {text}: {error}; is its folder on PYTHONPATH?") from error
