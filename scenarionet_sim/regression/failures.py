"""What went wrong in a scenario, from its row of results, and failures of one kind together."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

_PARTNERS = {"collided_humans": "a person", "collided_vehicles": "a vehicle", "collided_objects": "an object"}
_SIDES = {
    "active_front_collisions": ", ahead",
    "active_lateral_collisions": ", beside",
    "stopped_track_collisions": ", standing",
    "active_rear_collisions": ", from behind",
    "stopped_ego_collisions": ", the ego standing",
}
_OTHERS = (
    ("red_light_violations", "red light"),
    ("off_road_time", "off the road"),
    ("out_of_road", "left its route"),
    ("timeout", "too slow"),
)
"""Columns of results that are above 0 where it fails, the worst first."""

_SEVERITY = ("", "too slow", "left its route", "off the road", "red light", "collision", "could not be simulated")
"""Beginnings of kinds, the worst last."""

SPEEDS = (("slow", 5.0), ("urban", 15.0), ("fast", float("inf")))
"""Classes of the ego's mean speed, and where they end [m/s]."""


@dataclass(frozen=True)
class Failure:
    """A scenario that the new policy fails, and the old one does not fail or less badly.

    Attributes:
        scenario_id: The scenario.
        kind: See :func:`failure_kind`.
        change: Of the primary measure; below 0 is worse.
        speed: A name in SPEEDS.
        error: Why it could not be simulated; empty if it could.
    """

    scenario_id: str
    kind: str
    change: float
    speed: str
    error: str = ""


@dataclass(frozen=True)
class FailureCluster:
    """Failures of one kind at one class of speed, the worst first."""

    kind: str
    speed: str
    failures: tuple[Failure, ...]


def failure_kind(row: Mapping[str, Any], duration: float) -> str:
    """Return what went wrong, such as ``collision with a vehicle, ahead``; empty if nothing did.

    Args:
        row: Of ``results``.
        duration: Of the recording [s]; afterwards the others stand where they were, and contact does not count.
    """
    if row.get("error"):
        return "could not be simulated"
    first = row.get("first_collision")
    if first is not None and first <= duration:
        partner = next((name for column, name in _PARTNERS.items() if row.get(column)), "something")
        return f"collision with {partner}" + next((name for column, name in _SIDES.items() if row.get(column)), "")
    return next((name for column, name in _OTHERS if (row.get(column) or 0) > 0), "")


def severity(kind: str) -> int:
    """Return how bad a kind of failure is: 0 for none."""
    return max(number for number, word in enumerate(_SEVERITY) if kind.startswith(word))


def failure_of(row: Mapping[str, Any], change: float, duration: float) -> Failure:
    """Return the failure of a row of results; its kind is empty if nothing went wrong."""
    speed = row.get("mean_speed") or 0.0
    word = next(name for name, end in SPEEDS if speed < end)
    return Failure(row["scenario_id"], failure_kind(row, duration), change, word, row.get("error") or "")


def clustered(failures: Iterable[Failure]) -> tuple[FailureCluster, ...]:
    """Return failures of one kind and class of speed together, those that lose most in all first."""
    found: dict[tuple[str, str], list[Failure]] = {}
    for each in sorted(failures, key=lambda each: (each.change, each.scenario_id)):
        found.setdefault((each.kind, each.speed), []).append(each)
    clusters = [FailureCluster(*key, tuple(each)) for key, each in found.items()]
    return tuple(sorted(clusters, key=lambda each: (sum(one.change for one in each.failures), each.kind)))
