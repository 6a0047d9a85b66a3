"""Drivers and traffic of an evaluation, by name.

A driver of your own is a class named as ``module:Class``: a ``Planner``, which gets a view of the world in metres, a
``Policy``, which has access to everything, or a class with a method ``act`` that maps an observation to an action.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from scenarionet_data.errors import BadParameter, needing
from scenarionet_data.public_names import load_by_name
from scenarionet_data.storage.files.places import open_files
from scenarionet_sim.backends.base import Backend
from scenarionet_sim.backends.bullet import Bullet
from scenarionet_sim.backends.kinematic import Kinematic
from scenarionet_sim.bridges.carla.by_name import load_agent
from scenarionet_sim.bridges.commonroad.by_name import PLANNERS as OUTSIDE
from scenarionet_sim.bridges.commonroad.by_name import is_outside, load_planner
from scenarionet_sim.bridges.driver.planner import DriverPlanner, is_driver
from scenarionet_sim.bridges.stacks import StackPlanner, is_stack
from scenarionet_sim.drivers.code import AGENT, PolicyCode
from scenarionet_sim.drivers.trained import PREFIX, load_driver
from scenarionet_sim.planners.base import Planner
from scenarionet_sim.planners.following import ConstantVelocityPlanner, IdmPlanner, LogReplayPlanner, PurePursuitPlanner
from scenarionet_sim.planners.lane_graph import LaneGraphPlanner
from scenarionet_sim.planners.manual import GamePadPlanner, KeyboardPlanner
from scenarionet_sim.planners.policy import Planned
from scenarionet_sim.planners.safety import CarefulHumanPlanner, FuzzySafetyPlanner, RssPlanner
from scenarionet_sim.planners.tracking import Lqr, PerfectTracking, Tracker
from scenarionet_sim.policies.base import Policy
from scenarionet_sim.policies.constant_velocity import ConstantVelocity
from scenarionet_sim.policies.external import External
from scenarionet_sim.policies.idm import Idm
from scenarionet_sim.policies.objects import ego, vehicles_behind_ego
from scenarionet_sim.policies.replay import Replay
from scenarionet_sim.policies.sampled import NoisyVelocity, SampledIdm
from scenarionet_sim.policies.social_force import SocialForce
from scenarionet_sim.sensors.state import EgoState
from scenarionet_sim.worlds.lane_routes import LaneRoute

BACKENDS: dict[str, Backend] = {"kinematic": Kinematic(), "bullet": Bullet()}
DRIVERS: dict[str, Policy] = {
    "replay": Replay(objects=ego),
    "idm": Idm(objects=ego),
    "idm-sampled": SampledIdm(objects=ego),
    "constant": ConstantVelocity(objects=ego),
    "constant-noisy": NoisyVelocity(objects=ego),
}
PLANNERS: dict[str, type[Planner]] = {
    "log-planner": LogReplayPlanner,
    "constant-planner": ConstantVelocityPlanner,
    "pure-pursuit": PurePursuitPlanner,
    "idm-planner": IdmPlanner,
    "lane-graph": LaneGraphPlanner,
    "careful-human": CarefulHumanPlanner,
    "fuzzy-safety": FuzzySafetyPlanner,
    "rss": RssPlanner,
    "keyboard": KeyboardPlanner,
    "gamepad": GamePadPlanner,
}
"""Planners that come along."""

MANUAL = ("keyboard", "gamepad")
"""Those that a person drives, in one process."""


def drives_alone(policy: str) -> bool:
    """Return whether a policy drives one world at a time: a person's, or a stack in another process."""
    return policy in MANUAL or is_stack(policy)


TRACKERS: dict[str, Tracker] = {"lqr": Lqr(), "perfect": PerfectTracking()}
"""What follows the trajectories of planners."""

RANDOM = "random"
"""Name of the driver :class:`RandomActions`."""

TRAFFIC: dict[str, tuple[Policy, ...]] = {
    "replay": (Replay(),),
    "idm": (Replay(), Idm()),
    "idm-behind": (Replay(), Idm(objects=vehicles_behind_ego)),
    "idm-sampled": (Replay(), SampledIdm()),
    "idm-walking": (Replay(), Idm(), SocialForce()),
    "constant": (ConstantVelocity(),),
    "constant-noisy": (NoisyVelocity(),),
}
REACTIVE = ("idm", "idm-behind", "idm-sampled", "idm-walking")
"""Traffic that reacts to the ego; a model of traffic does, too."""

MODEL = "model:"
"""Beginning of the name of a model of traffic, before that of its training run."""


ROUTES: dict[str, LaneRoute | None] = {"log": None, "lanes": LaneRoute()}
"""Routes of the ego: the recorded path, or the lanes to its end."""


@runtime_checkable
class Driver(Protocol):
    """Drives from observations; constructed without arguments, once for each scenario that is simulated at once.

    Optional members: ``sensors``, a tuple of sensors (default: the paper's observation), ``reset()``, called
    before each scenario, and after it ``seed(rng)``, with the random numbers of the rollout; ``act_batch``, see
    :class:`BatchDriver`.
    """

    def act(self, observation: Any) -> npt.ArrayLike:
        """Return steering and throttle in [-1, 1] for a flat observation of the ego (D,) float32."""
        ...


@runtime_checkable
class BatchDriver(Driver, Protocol):
    """A driver that answers several egos at once and remembers nothing; constructed once.

    A matrix product rounds differently for other numbers of rows, so the results of a network depend in their last
    digits on which scenarios run at once; ``act`` alone avoids that.
    """

    def act_batch(self, observations: Any) -> npt.ArrayLike:
        """Return steering and throttle (A, 2) in [-1, 1] for flat observations (A, D) float32."""
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
        make_driver: Returns another such driver, for another ego.
    """

    policies: tuple[Policy, ...]
    driver: Driver | None
    make_driver: Callable[[], Driver] = RandomActions


def resolve_drivers(
    policy: str,
    traffic: str = "replay",
    backend: str = "kinematic",
    tracker: str = "lqr",
    route: str = "log",
    lake: str | None = None,
) -> Drivers:
    """Return the drivers of ego and traffic.

    Args:
        policy: A name in DRIVERS or PLANNERS, a stack (``bridges.stacks``) or a driver (``bridges.driver``) in another
            process or a container, ``module:Class``, ``runs/NAME`` of a
            training run, or, in its process, pinned code (see ``drivers.code``) or a planner of CommonRoad.
        traffic: A name in TRAFFIC, or ``model:RUN`` of a training run of tokens.
        backend: A name in BACKENDS: the vehicle of a planner that returns actions.
        tracker: A name in TRACKERS: what follows the trajectories of a planner.
        route: ``log`` for the recorded path of the ego, ``lanes`` for the way along the lanes to its end.
        lake: The lake that has the training run.

    Raises:
        BadParameter: A name is unknown, or the class is no planner, policy or driver.
        LakeError: A model of traffic cannot be loaded.
    """
    along = _lookup(ROUTES, route, "route")
    others = _of_model(traffic, lake) if is_model(traffic) else _lookup(TRAFFIC, traffic, "traffic")
    vehicle, follows = find_backend(backend), _lookup(TRACKERS, tracker, "tracker")
    if lake is not None and policy.startswith(PREFIX):
        trained = load_driver(open_files(lake), policy)
        return Drivers((*others, External(route=along)), trained, lambda: trained)  # it remembers nothing
    if is_model(policy):
        own = () if policy == traffic else (replace(*_of_model(policy, lake), objects=ego),)  # one memory for all
        return Drivers((*others, *own), None)
    if policy == RANDOM:
        return Drivers((*others, External(route=along)), RandomActions())
    if policy in PLANNERS or is_outside(policy):
        planner = load_planner(policy) if is_outside(policy) else PLANNERS[policy]
        planned = Planned(planner=planner, tracker=follows, backend=vehicle, route=along)
        return Drivers((*others, planned), None)
    if is_stack(policy) or is_driver(policy):
        stack = partial(DriverPlanner if is_driver(policy) else StackPlanner, policy)
        stack()  # whether there is such a stack
        return Drivers((*others, Planned(planner=stack, tracker=follows, backend=vehicle, route=along)), None)
    if ":" not in policy:
        return Drivers((*others, replace(_lookup(DRIVERS, policy, "policy"), route=along)), None)
    code = PolicyCode.of(policy)
    if code is not None and str(code.folder) not in sys.path:
        raise BadParameter(f"{policy} runs in a process of its own; simulate it by evaluate() or scenarionet sim")
    if code is not None and policy.startswith(AGENT):
        planned = Planned(planner=load_agent(code.reference), tracker=follows, backend=vehicle, route=along)
        return Drivers((*others, planned), None)
    kind = load_by_name(policy if code is None else code.reference)
    if isinstance(kind, type) and issubclass(kind, Planner):
        return Drivers((*others, Planned(planner=kind, tracker=follows, backend=vehicle, route=along)), None)
    made = kind()
    if isinstance(made, Policy):
        return Drivers((*others, replace(made, objects=ego, route=along or made.route)), None)
    if isinstance(made, Driver):
        return Drivers((*others, External(route=along)), made, kind)
    raise BadParameter(
        f"{policy} is not a driver: expected a subclass of Planner or Policy, or a class with act(observation)"
    )


def is_model(name: str) -> bool:
    """Return whether it names a model of traffic: ``model:RUN``."""
    return name.startswith(MODEL)


def _of_model(name: str, lake: str | None) -> tuple[Policy, ...]:
    """The policy of a model of traffic of a lake."""
    with needing("a model of traffic needs torch", "learn"):
        from scenarionet_sim.policies.tokens import TokenTraffic, loaded  # lazy: torch
    run, lake = name.removeprefix(MODEL), lake or "."
    loaded(lake, run)  # whether there is such a model
    return (TokenTraffic(run=run, lake=lake),)


def find_backend(name: str) -> Backend:
    """Return a backend by name.

    Raises:
        BadParameter: The name is unknown.
    """
    backend: Backend = _lookup(BACKENDS, name, "backend")
    return backend


def _lookup(choices: dict[str, Any], name: str, kind: str) -> Any:
    if name not in choices:
        own = (
            ", runs/NAME of a training run, or your own as [git:REF:]module:Class or file.py:Class"
            if kind == "policy"
            else ""
        )
        names = [*choices, *PLANNERS, RANDOM, *OUTSIDE] if kind == "policy" else choices
        raise BadParameter(f"unknown {kind} {name!r}; choose from {', '.join(names)}{own}")
    return choices[name]
