"""What an evaluation is made of: its drivers, scenarios and episode, and by which rule it is scored."""

from __future__ import annotations

import hashlib
from dataclasses import asdict, dataclass
from functools import cache
from typing import Any

from scenarionet_data import Lake, ScenarioLoader, version
from scenarionet_sim.bridges.commonroad.by_name import is_outside
from scenarionet_sim.drivers.by_name import Drivers, resolve_drivers
from scenarionet_sim.drivers.code import policy_name

PART_SIZE = 32
"""Rollouts per part: the most work that a killed worker loses."""

OUTSIDE_PART_SIZE = 2
"""Likewise of planners of CommonRoad, which take a second for each of a scenario: worlds gain nothing together."""

RULE = "to the end of the episode, off the road only where the recording is on it, progress along its lanes"
"""What metrics cover. Runs from before there was a choice of words say nothing: an ego of IDM that had reached the end
of its path was scored until then, and the road counted where the recording itself is off it. Runs that do not say
"along its lanes" measured progress along the recorded path."""


@dataclass(frozen=True)
class Evaluation:
    """Specification of an evaluation; picklable.

    Attributes:
        lake: Path or URL of the lake.
        database: ``name@version``, scenario ids, or None for the whole lake.
        snapshot: Number of the lake's snapshot.
        policy: Driver of the ego: a name in ``DRIVERS``, ``random``, or ``module:Class``.
        traffic: Driver of all other objects: a name in ``TRAFFIC``, or ``model:RUN``.
        backend: Vehicle dynamics of an ego driven by actions: ``bullet`` or ``kinematic``.
        seed: Seed of stochastic policies and of the sensors' noise.
        rollouts: Number of rollouts of each scenario.
        episode: A name in ``EPISODES``.
        tracker: A name in ``TRACKERS``.
        route: A name in ``ROUTES``.
        python: Interpreter of the policy, in a process of its own; empty for this one.
        code: Digest of the modules of a policy in a process of its own, or versions of the packages it is in.
    """

    lake: str
    database: str | tuple[str, ...] | None
    snapshot: int
    policy: str
    traffic: str = "replay"
    backend: str = "kinematic"
    seed: int = 0
    rollouts: int = 1
    episode: str = "log"
    tracker: str = "lqr"
    route: str = "log"
    python: str = ""
    code: str = ""

    @property
    def part_size(self) -> int:
        """Rollouts per part."""
        return min(PART_SIZE, OUTSIDE_PART_SIZE) if is_outside(self.policy) else PART_SIZE

    @property
    def description(self) -> dict[str, Any]:
        """Everything the results depend on, as stored with the run."""
        spec = {name: value for name, value in asdict(self).items() if name != "lake"}
        spec["database"] = describe_database(self.database)
        for name in ("tracker", "route", "python", "code"):  # as in runs from before there was a choice
            if spec[name] == getattr(type(self), name):
                del spec[name]
        return spec | {"rule": RULE, "part": self.part_size, "software": version.name_and_version()}

    @property
    def default_name(self) -> str:
        """Name of the run unless one is given: database, policy, traffic and backend, and the episode if not all."""
        words = [describe_database(self.database) or "all", policy_name(self.policy), self.traffic, self.backend]
        words += [value for value in (self.episode, self.route) if value != "log"]
        name = "-".join(words if self.tracker == "lqr" else [*words, self.tracker])
        return name.replace("@", ".").replace(":", ".").replace("/", ".")

    def drivers(self) -> Drivers:
        """Return the drivers of ego and traffic; raises if one is unknown."""
        return resolve_drivers(self.policy, self.traffic, self.backend, self.tracker, self.route, self.lake)


def describe_database(database: str | tuple[str, ...] | None) -> str | None:
    """Return a reference unchanged, and a list of ids as its length and digest."""
    if not isinstance(database, tuple):
        return database
    digest = hashlib.sha256("\n".join(database).encode()).hexdigest()[:12]
    return f"{len(database)}-scenarios-{digest}"


@cache
def scenarios_of(evaluation: Evaluation) -> ScenarioLoader:
    """Return the scenarios of an evaluation, resolved once per process."""
    return ScenarioLoader(Lake(evaluation.lake, evaluation.snapshot), evaluation.database)
