"""Moments: spans of time at which something holds of an object, or of two objects, composed to one SELECT.

A :func:`relation` holds at single steps; ``&``, ``|``, ``~``, ``reversed`` and ``at_least`` combine steps, ``lasting``
makes spans of them, and ``before``, ``after``, ``during`` and ``overlaps`` relate spans. Nothing is computed until
:meth:`Lake.moments <scenarionet_data.Lake.moments>` runs the SELECT, which is the attribute ``sql`` of each of them.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from scenarionet_data.arrays.dtypes import is_count
from scenarionet_data.errors import BadParameter
from scenarionet_data.operations.narrowing import OTHER as _OTHER
from scenarionet_data.operations.narrowing import TRACK as _TRACK
from scenarionet_data.operations.narrowing import narrowed_roles, together
from scenarionet_data.query.named_sql import EVENTS, RELATIONS, NamedSql
from scenarionet_data.query.statements import quoted, words
from scenarionet_data.scenario.settings import check_is

NAMED = re.compile(r"/\* (\w+) (\{.*?\}) \*/")
"""The comment before the SQL of a relation: its name and the values of its parameters."""
_SWAPPED = {_TRACK: _OTHER, _OTHER: _TRACK}


@dataclass(frozen=True)
class Moments:
    """Spans of time at which something holds.

    Attributes:
        sql: SELECT of scenario_id, the roles, first_timestep, last_timestep, and their times ``begins`` and ``ends``
            from the scenario's first timestep [s].
        roles: ``track_id``, ``other_id`` or both, in this order.
        measures: Columns with what was measured: ``value`` of an event.
    """

    sql: str
    roles: tuple[str, ...]
    measures: tuple[str, ...] = ()

    def lasting(self, seconds: float) -> Moments:
        """Keep those that last for at least some seconds."""
        return replace(self, sql=f"SELECT * FROM (\n{self.sql}\n) WHERE ends - begins >= {_seconds(seconds)}")

    def before(self, later: Moments, within: float) -> Moments:
        """Return spans from the beginning of one of these to the end of a later one that begins soon after it ends.

        Args:
            later: Moments of the same objects in the roles that both have.
            within: Longest time in between [s].
        """
        when = f"b.begins BETWEEN a.ends AND a.ends + {_seconds(within)}"
        return self._related(later, when, "a.first_timestep, b.last_timestep, a.begins, b.ends")

    def after(self, earlier: Moments, within: float) -> Moments:
        """Return spans from an earlier one to the end of one of these; the same as ``earlier.before(self, within)``."""
        return earlier.before(self, within)

    def during(self, outer: Moments) -> Moments:
        """Return those that lie inside another one."""
        when = "a.first_timestep >= b.first_timestep AND a.last_timestep <= b.last_timestep"
        return self._related(outer, when, "a.first_timestep, a.last_timestep, a.begins, a.ends")

    def overlaps(self, other: Moments) -> Moments:
        """Return the spans that these have in common with others."""
        when = "a.first_timestep <= b.last_timestep AND b.first_timestep <= a.last_timestep"
        span = (
            "greatest(a.first_timestep, b.first_timestep) AS first_timestep, "
            "least(a.last_timestep, b.last_timestep) AS last_timestep, "
            "greatest(a.begins, b.begins) AS begins, least(a.ends, b.ends) AS ends"
        )
        return self._related(other, when, span)

    def _related(self, other: Moments, when: str, span: str) -> Moments:
        """Join two kinds of moments on the scenario and the roles that both have."""
        other = spans_of(other)
        sql = (
            f"SELECT DISTINCT {_columns(_joined(self.roles, other.roles))}, {span}\n"
            f"FROM (\n{self.sql}\n) AS a JOIN (\n{other.sql}\n) AS b "
            f"USING ({_columns(_shared(self.roles, other.roles))})\nWHERE {when}"
        )
        return Moments(sql, _joined(self.roles, other.roles))


@dataclass(frozen=True)
class RelationSteps:
    """Single steps at which something holds.

    Attributes:
        sql: SELECT of scenario_id, the roles, and timestep, each row once.
        roles: ``track_id``, ``other_id`` or both, in this order.
        denied: The steps that these are all others of, for ``~``.
        narrows: Roles whose objects and steps may be narrowed first, see :mod:`.narrowing`.
        parts, without: What holds together, and what does not, in one made by ``&``.
    """

    sql: str
    roles: tuple[str, ...]
    denied: RelationSteps | None = None
    narrows: tuple[str, ...] = ()
    parts: tuple[RelationSteps, ...] = ()
    without: tuple[RelationSteps, ...] = ()

    def __and__(self, other: RelationSteps) -> RelationSteps:
        """Return the steps at which both hold, of the same objects in the roles that both have."""
        _check_steps(other, "&")
        if self.denied is not None and other.denied is None:
            return other & self
        if other.denied is not None and set(other.roles) <= set(self.roles):
            # without the complement, which has all pairs of objects
            parts, without = self.parts or (self,), (*self.without, other.denied)
        else:
            parts = (*(self.parts or (self,)), *(other.parts or (other,)))
            without = (*self.without, *other.without)
        roles = _joined(self.roles, other.roles)
        return RelationSteps(together(parts, without), roles, parts=parts, without=without)

    def __or__(self, other: RelationSteps) -> RelationSteps:
        """Return the steps at which at least one holds.

        Raises:
            BadParameter: They have different roles.
        """
        _check_steps(other, "|")
        if self.roles != other.roles:
            raise BadParameter(
                f"| wants the same roles on both sides, found {_named(self.roles)} and {_named(other.roles)}; "
                "use at_least(1) or reversed() on one of them"
            )
        columns = f"{_columns(self.roles)}, timestep"
        sql = f"SELECT {columns} FROM (\n{self.sql}\n)\nUNION SELECT {columns} FROM (\n{other.sql}\n)"
        return RelationSteps(sql, self.roles)

    def __invert__(self) -> RelationSteps:
        """Return all other steps at which the objects were observed, both of a pair."""
        if self.denied is not None:
            return self.denied
        view = "pairs" if len(self.roles) > 1 else "object_states"
        column = "track_id AS other_id" if self.roles == (_OTHER,) else ", ".join(self.roles)
        observed = RelationSteps(f"SELECT scenario_id, {column}, timestep FROM {view}", self.roles)
        return RelationSteps(together([observed], [self]), self.roles, denied=self)

    def reversed(self) -> RelationSteps:
        """Return the same steps with the roles swapped: what held of the object holds of the other."""
        swapped = ", ".join(f"{role} AS {_SWAPPED[role]}" for role in self.roles)
        roles = _joined(tuple(_SWAPPED[role] for role in self.roles), ())
        denied = None if self.denied is None else self.denied.reversed()
        return RelationSteps(f"SELECT scenario_id, {swapped}, timestep FROM (\n{self.sql}\n)", roles, denied)

    def at_least(self, count: int) -> RelationSteps:
        """Return the steps at which it holds with at least a number of others at once.

        Raises:
            BadParameter: There are no others, or the number is not positive.
        """
        if len(self.roles) < 2 or not is_count(count, 1):
            raise BadParameter(f"at_least({count}) of {_named(self.roles)}: wanted 1 or more, of a relation of two")
        sql = f"SELECT scenario_id, track_id, timestep\nFROM (\n{self.sql}\n)\nGROUP BY ALL HAVING count(*) >= {count}"
        return RelationSteps(sql, (_TRACK,))

    def lasting(self, seconds: float = 0.0) -> Moments:
        """Return the uninterrupted runs of steps of at least some seconds from the first to the last step.

        A timestep at which an object was not observed ends its run.
        """
        return Moments(_timed(runs_of(self.sql, self.roles)), self.roles).lasting(seconds)


def runs_of(steps: str, roles: tuple[str, ...]) -> str:
    """Return the SELECT of the uninterrupted runs of the steps that another one selects."""
    columns = _columns(roles)
    return (
        "WITH runs AS (\n"
        f"SELECT *, timestep - row_number() OVER (PARTITION BY {columns} ORDER BY timestep) AS run\n"
        f"FROM (\n{steps}\n)\n)\n"
        f"SELECT {columns}, min(timestep) AS first_timestep, max(timestep) AS last_timestep\n"
        f"FROM runs GROUP BY {columns}, run"
    )


def spans_of(found: RelationSteps | Moments) -> Moments:
    """Return moments; of steps, the spans in which they follow each other.

    Raises:
        BadParameter: It is neither.
    """
    if not isinstance(found, RelationSteps | Moments):
        raise BadParameter(f"expected moments, such as following() & turning(), found {found!r}; see moments.py")
    return found if isinstance(found, Moments) else found.lasting()


def _check_steps(other: object, sign: str) -> None:
    if isinstance(other, Moments):
        raise BadParameter(f"{sign} combines steps, such as relation('following'), and these are spans; use overlaps")
    check_is("steps", other, RelationSteps, f"steps, such as relation('following'), on the right of {sign}")


def relation(name: str, parameters: Mapping[str, Any] | None = None) -> RelationSteps:
    """Return the steps at which a relation of ``sql/relations`` holds.

    Args:
        name: Name of its file.
        parameters: Values of its parameters as Python values; the others keep their defaults.

    Raises:
        UnknownRelation: No such relation.
        BadParameter: No such parameter, or a value of another type.
    """
    found = RELATIONS.load(name)
    roles = (_TRACK, _OTHER) if _OTHER in found.text else (_TRACK,)
    values = found.bind(parameters or {})
    sql = f"/* {name} {json.dumps(values)} */\n{inlined(found, parameters)}"  # see NAMED
    return RelationSteps(sql, roles, narrows=narrowed_roles(found.text, values))


def event(name: str, parameters: Mapping[str, Any] | None = None) -> Moments:
    """Return the occurrences of an event of ``sql/events``.

    Args:
        name: Name of its file.
        parameters: Values of its parameters as Python values; the others keep their defaults.

    Raises:
        UnknownEvent: No such event.
        BadParameter: No such parameter, or a value of another type.
    """
    found = EVENTS.load(name)
    roles = (_TRACK,) if "NULL::VARCHAR AS other_id" in found.text else (_TRACK, _OTHER)
    hits = f"SELECT {_columns(roles)}, first_timestep, last_timestep, value FROM (\n{inlined(found, parameters)}\n)"
    return Moments(_timed(hits), roles, ("value",))


def selected(sql: str) -> Moments:
    """Return the moments that a SELECT of your own finds.

    Args:
        sql: SELECT over the views of the lake, of scenario_id, track_id, other_id (or only one of these),
            first_timestep and last_timestep; and ``value``, if something is measured.

    Raises:
        BadParameter: It names neither track_id nor other_id, or no timesteps.
    """
    named = words(sql)
    roles = tuple(role for role in (_TRACK, _OTHER) if role in named)
    missing = {"scenario_id", "first_timestep", "last_timestep"} - named
    if not roles or missing:
        lacks = ", ".join(sorted(missing)) or f"{_TRACK} or {_OTHER}"
        raise BadParameter(
            f"SQL of moments selects scenario_id, {_TRACK}, first_timestep, ...; it lacks {lacks}: {sql}"
        )
    measures = ("value",) if "value" in named else ()
    columns = ", ".join(("scenario_id", *roles, *measures))
    there = "FROM tracks WHERE tracks.scenario_id = found.scenario_id AND track_id ="
    wrong = "\n".join(
        f"WHEN found.{role} IS NOT NULL AND NOT EXISTS (SELECT 1 {there} found.{role}) "
        f"THEN concat('there is no track ', found.{role})"
        for role in roles
    )
    checked = (
        f"SELECT {columns}, last_timestep, CASE WHEN wrong IS NULL THEN first_timestep ELSE error(concat("
        "'SQL of moments: ', scenario_id, ', timesteps ', first_timestep, ' to ', last_timestep, ': ', wrong"
        f")) END AS first_timestep\nFROM (SELECT found.*, CASE\n{wrong}\n"
        "WHEN first_timestep IS NULL OR last_timestep IS NULL THEN 'a moment has a first and a last one'\n"
        "WHEN last_timestep < first_timestep THEN 'a moment does not end before it begins'\n"
        "WHEN first_timestep < 0 OR last_timestep >= num_timesteps THEN concat('there are 0 to ', num_timesteps - 1)\n"
        f"END AS wrong\nFROM (\n{sql}\n) AS found\n"
        "JOIN (SELECT scenario_id, num_timesteps FROM metadata_rows) USING (scenario_id))"
    )
    return Moments(_timed(checked), roles, measures)


def _timed(spans: str) -> str:
    """Return SQL that adds the times of first_timestep and last_timestep [s]."""
    begins, ends = (
        f"coalesce(timestamps[{step} + 1], {step} * dt) AS {name}"
        for step, name in (("first_timestep", "begins"), ("last_timestep", "ends"))
    )
    times = "(SELECT scenario_id, timestamps, dt FROM metadata_rows)"
    return f"SELECT * EXCLUDE (timestamps, dt), {begins}, {ends}\nFROM (\n{spans}\n) JOIN {times} USING (scenario_id)"


def inlined(found: NamedSql, parameters: Mapping[str, Any] | None) -> str:
    """Return the SQL of a file with the values of its parameters as literals."""
    values = found.bind(parameters or {})
    return re.sub(r"\$(\w+)", lambda name: _literal(values[name[1]]), found.text)


def _literal(value: Any) -> str:
    if isinstance(value, list):
        return f"[{', '.join(map(_literal, value))}]"
    if isinstance(value, float) and not math.isfinite(value):
        return f"'{value}'::DOUBLE"
    return quoted(value) if isinstance(value, str) else str(value).lower()


def _seconds(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value < math.inf:
        raise BadParameter(f"wanted a number of seconds from 0 on, found {value!r}")
    return float(value)


def _joined(first: tuple[str, ...], second: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(role for role in (_TRACK, _OTHER) if role in first + second)


def _shared(first: tuple[str, ...], second: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(role for role in first if role in second)


def _columns(roles: tuple[str, ...]) -> str:
    return ", ".join(("scenario_id", *roles))


def _named(roles: tuple[str, ...]) -> str:
    return " and ".join(role.removesuffix("_id") for role in roles)
