"""The SELECT of relations that hold together: pairs are formed only of objects and at steps at which the rest holds.

A relation says in a comment behind ``FROM pairs`` what its answer about a pair at a step depends on: on this pair alone
(``each pair``), or on all others of the same object at this step (``each object``); without a comment, nothing may be
left out. Then what holds of one object alone is found first, and pairs are joined from the objects that are left.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, Protocol

from scenarionet_data.schema.package_data import SQL

TRACK, OTHER = "track_id", "other_id"
_FROM_PAIRS = re.compile(r"FROM pairs  -- each (object|pair)(?:, each pair if ([^\n]*))?")
_SIDES = {TRACK: ("t", "left_tracks"), OTHER: ("o", "left_others")}  # "objects" is a view, which would be looked up


class HeldSteps(Protocol):
    """What holds at single steps, see :class:`~scenarionet_data.operations.moments.RelationSteps`."""

    @property
    def sql(self) -> str:
        """SELECT of scenario_id, the roles and timestep."""

    @property
    def roles(self) -> tuple[str, ...]:
        """``track_id``, ``other_id`` or both."""

    @property
    def narrows(self) -> tuple[str, ...]:
        """Roles whose objects and steps may be narrowed first."""


def narrowed_roles(text: str, values: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the roles whose objects and steps may be narrowed before a relation of two is computed.

    Args:
        text: The SQL of the relation.
        values: Values of its parameters.
    """
    found = _FROM_PAIRS.search(text)
    if found is None:
        return ()
    limits = dict(limit.split(" = ") for limit in (found[2] or "").split(", ") if limit)
    is_each = found[1] == "pair" or (limits and all(values[name] == float(limit) for name, limit in limits.items()))
    return (TRACK, OTHER) if is_each else (TRACK,)


def together(parts: Sequence[HeldSteps], without: Sequence[HeldSteps] = ()) -> str:
    """Return the SELECT of the steps at which all parts hold, of the same objects in the roles that they share.

    Args:
        parts: What holds.
        without: What does not, of roles that the parts have.
    """
    pairs = [part for part in parts if len(part.roles) > 1]
    singles = {role: [part for part in parts if part.roles == (role,)] for role in (TRACK, OTHER)}
    narrowed = {role for role in singles if singles[role] and any(role in pair.narrows for pair in pairs)}
    first = [
        f"{_SIDES[role][1]} AS MATERIALIZED (\n{_joined([part.sql for part in singles[role]], [[role]])}\n)"
        for role in singles
        if role in narrowed
    ]
    left = [part for part in parts if len(part.roles) > 1 or part.roles[0] not in narrowed]
    sql = _joined([_narrow(part, narrowed) for part in left], [part.roles for part in left])
    for part in without:
        columns = ", ".join(("scenario_id", *part.roles, "timestep"))
        sql = f"SELECT * FROM (\n{sql}\n) ANTI JOIN (\n{_narrow(part, narrowed)}\n) USING ({columns})"
    return f"WITH {', '.join(first)}\n{sql}" if first else sql


def _joined(queries: Sequence[str], roles: Sequence[Sequence[str]]) -> str:
    """Return the SELECT of rows that all queries have in common, in the roles that they share."""
    roles = list(roles) * len(queries) if len(roles) == 1 else roles
    sql, so_far = f"(\n{queries[0]}\n)", set(roles[0])
    for query, those in zip(queries[1:], roles[1:], strict=True):
        using = ", ".join(
            ("scenario_id", *(role for role in (TRACK, OTHER) if role in so_far & set(those)), "timestep")
        )
        sql += f" JOIN (\n{query}\n) USING ({using})"
        so_far |= set(those)
    return f"SELECT {', '.join(('scenario_id', *(r for r in (TRACK, OTHER) if r in so_far), 'timestep'))}\nFROM {sql}"


def _narrow(part: HeldSteps, roles: set[str]) -> str:
    """Return the SELECT of a relation of two over the pairs that are left."""
    source = _pairs()
    for role in roles & set(part.narrows):
        side, steps = _SIDES[role]
        keys = f"SELECT scenario_id, {role} AS track_id, timestep FROM {steps}"
        left = f"(SELECT * FROM smoothed SEMI JOIN ({keys}) USING (scenario_id, track_id, timestep)) AS {side} "
        source = source.replace(f"smoothed AS {side} ", left)
    return _FROM_PAIRS.sub(f"FROM (\n{source}\n) AS pairs", part.sql, 1) if roles & set(part.narrows) else part.sql


@cache
def _pairs() -> str:
    """The SELECT of the view pairs."""
    return (SQL / "views/pairs.sql").read_text("utf-8").partition("CREATE VIEW pairs AS\n")[2].rstrip().rstrip(";")
