"""Splits: every scenario gets a share of [0, 1) or a part by name; the parts are disjoint and leave nothing over."""

from __future__ import annotations

import re
import warnings
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass
from fractions import Fraction
from itertools import accumulate
from typing import TYPE_CHECKING, Any, Unpack

import pyarrow as pa
import pyarrow.compute as pc

from scenarionet_data.databases import record as databases
from scenarionet_data.databases import writer
from scenarionet_data.databases.record import Database, Lineage
from scenarionet_data.databases.writer import Draft
from scenarionet_data.errors import BadParameter, EmptyResult, LakeError, LeakingSplit
from scenarionet_data.operations import database_query as pools
from scenarionet_data.operations.database_query import Pool, Saving

if TYPE_CHECKING:
    from scenarionet_data.lake.lake import Lake

_MAX_PARTS = 100


class LeakWarning(UserWarning):
    """Scenarios of one source log stand in several parts of a split."""


@dataclass(frozen=True)
class Plan:
    """A split before it is saved.

    Attributes:
        query: Selects scenario_id, weight, content_hash and ``part`` of every scenario of the pool.
        parameters: Its parameters.
        names: Database of each part.
    """

    query: str
    parameters: dict[str, Any]
    names: dict[str, str]


def split(
    lake: Lake,
    parent: Database | str | None,
    fractions: Mapping[str, float] | None = None,
    *,
    seed: int = 0,
    by: str = "scenario_id",
    stratify: str | None = None,
    along: str | None = None,
    levels: int | None = None,
    each: str | None = None,
    prefix: str | None = None,
    strict: bool = False,
    **saving: Unpack[Saving],
) -> dict[str, Database]:
    """Part a database: by fractions, into levels, or by the values of a column.

    By fractions alone, each scenario (or group, for example ``by="source_log"``) falls into a part by a hash of its
    id and the seed, so that it keeps its part as the lake grows, on every machine. ``stratify`` gives every part its
    fraction of each value of a column, and ``along`` parts in the order of a column, for example a date: both look
    at the whole, and a lake that grows is parted anew.

    Args:
        lake: The lake.
        parent: The database to part; the whole lake for None.
        fractions: Part name to fraction; they add up to 1.
        seed: Another seed, another split.
        by: Column whose equal values stay together.
        stratify: Column each of whose values is parted by the fractions.
        along: Column in whose order the parts follow each other; equal values stay together.
        levels: In place of fractions: this many parts ``level1``, ... of equal size in the order of ``along``
            (difficulty unless given).
        each: In place of fractions: one part for every value of this column.
        prefix: Parts are saved as ``<prefix>_<part>``; the parent's name unless given.
        strict: Refuse a split that leaks, in place of a warning.
        **saving: ``replace``, ``allow_empty``.

    Raises:
        BadParameter: Fractions do not add up to 1, there is no such column, or the arguments exclude each other.
        LeakingSplit: Source logs stand in several parts, and ``strict`` is True.
        DatabaseExists, EmptyResult: See :class:`Saving`; then no part is saved.
    """
    pool = pools.of(lake, parent)
    stem = prefix or (pool.parents[0].name if pool.parents else "all")
    _check_ways(fractions, levels, each, stratify, along)
    if each is not None:
        plan = _by_value(pool, each, stem)
    else:
        if levels is not None:
            fractions, along = _equal(levels), along or "difficulty"
        plan = _by_share(pool, fractions or {}, seed, by, stratify, along, "levels" if levels else "along", stem)
    for name in plan.names.values():
        databases.check_free(lake.files, name, replace=saving.get("replace", False))
    with writer.drafts(lake.files, plan.names) as made:
        with closing(pool.batches(plan.query, plan.parameters)) as batches:
            for rows in batches:
                for part, draft in made.items():
                    draft.add(writer.only(rows, "part", part))
        _check_parts(pool, {part: draft.count for part, draft in made.items()}, saving)
        for part, draft in made.items():
            draft.finish(_lineage(pool, plan, part))
        if levels is None and each is None and by != "source_log":
            _check_leaks(pool, made, strict)
        replace = saving.get("replace", False)
        return {part: draft.publish(plan.names[part], replace=replace) for part, draft in made.items()}


def _check_ways(
    fractions: Mapping[str, float] | None,
    levels: int | None,
    each: str | None,
    stratify: str | None,
    along: str | None,
) -> None:
    """Refuse arguments of which one would be ignored."""
    if [fractions is not None, levels is not None, each is not None].count(True) != 1:
        raise BadParameter("wanted one of fractions (train=0.9 val=0.1), a number of levels, or each with a column")
    if stratify is not None and (along is not None or fractions is None):
        raise BadParameter("stratify goes with fractions alone: not with along, levels or each")
    if each is not None and along is not None:
        raise BadParameter("each makes a part for every value, in no order: leave along out")


def _by_share(
    pool: Pool,
    fractions: Mapping[str, float],
    seed: int,
    by: str,
    stratify: str | None,
    along: str | None,
    ordered: str,
    stem: str,
) -> Plan:
    """Parts as intervals of [0, 1)."""
    bounds = upper_bounds(fractions)
    for column, purpose in ((by, "to split by"), (stratify, "to stratify by"), (along, "to split along")):
        if column is not None:
            pools.check_column(pool.lake, column, purpose)
    if along is not None:
        _check_known(pool, along)
    way = "stratified" if stratify else ordered if along else "by_hash"
    words = {"by": by, "stratify": stratify or "", "along": along or ""}
    luck = {"drawn_kin": pools.drawn("kin"), "drawn_stratum": pools.drawn("'stratum:' || coalesce(stratum, '')")}
    if way == "by_hash" and by == "scenario_id":
        words |= {"pool": pool.bare}  # nothing else is asked of metadata: half the time
    shares = pool.query(f"splits/{way}", **words, **luck)
    cases = [f"WHEN share < $upper_{number} THEN $part_{number}" for number in range(len(bounds))]
    query = pool.query("operations/split", shares=shares, cases=" ".join(cases))
    parameters: dict[str, Any] = {f"part_{number}": part for number, part in enumerate(fractions)}
    parameters |= {f"upper_{number}": bound for number, bound in enumerate(bounds)}
    if along is None:
        parameters |= {"seed": seed}
    return Plan(query, parameters, {part: f"{stem}_{part}" for part in fractions})


def _by_value(pool: Pool, column: str, stem: str) -> Plan:
    """One part for every value of a column; the names keep what a name may hold of it."""
    pools.check_column(pool.lake, column, "to split by")
    query = pool.query("splits/each", each=column)
    found = pool.run(f"SELECT part FROM ({query}) GROUP BY part ORDER BY part LIMIT {_MAX_PARTS + 1}", {})
    values: list[str] = found["part"].to_pylist()
    if len(values) > _MAX_PARTS:
        raise BadParameter(f"{column} has more than {_MAX_PARTS} values: too many for a database each")
    names = {value: f"{stem}_{re.sub(r'[^A-Za-z0-9._-]', '_', value)}" for value in values}
    if len(set(names.values())) < len(names):
        raise BadParameter(f"two values of {column} would get the same name: filter by it instead")
    return Plan(query, {}, names)


def upper_bounds(fractions: Mapping[str, float]) -> list[float]:
    """Where each part of a split ends in [0, 1].

    Raises:
        BadParameter: The fractions are not above 0, or do not add up to 1.
    """
    if not fractions or any(not fraction > 0 for fraction in fractions.values()):
        raise BadParameter("wanted at least one part, each with a fraction above 0, for example train=0.9 val=0.1")
    exact = [Fraction(repr(float(fraction))) for fraction in fractions.values()]  # 0.2 + 0.2 + 0.2 is 0.6
    total = sum(exact, Fraction())
    if abs(float(total) - 1) > 1e-6:
        raise BadParameter(f"wanted fractions that add up to 1, found {float(total):g}")
    return [float(upper / total) for upper in accumulate(exact)]


def _equal(levels: int) -> dict[str, float]:
    if levels < 1:
        raise BadParameter(f"wanted 1 level or more, found {levels}")
    return {f"level{number}": 1.0 / levels for number in range(1, levels + 1)}


def _check_known(pool: Pool, along: str) -> None:
    """Refuse scenarios whose place in the order nobody knows."""
    query = pool.query("operations/filter", conditions=f'"{along}" IS NULL')
    unknown = pool.run(query, {}).num_rows
    if unknown:
        raise BadParameter(
            f'{unknown:,} of {len(pool):,} scenarios have no {along}: filter by "{along} IS NOT NULL" first'
        )


def _check_parts(pool: Pool, counts: Mapping[str, int], saving: Saving) -> None:
    """Make sure that every scenario is in one part, and no part is empty."""
    total = sum(counts.values())
    if total != len(pool):
        raise LakeError(f"{total:,} of {len(pool):,} scenarios fell into a part: run `scenarionet check`")
    empty = [part for part, count in counts.items() if not count]
    if empty and not saving.get("allow_empty", False):
        raise EmptyResult(
            f"no scenario of {len(pool):,} falls into {', '.join(empty)}; "
            "other fractions, another seed, or --allow-empty"
        )


def _check_leaks(pool: Pool, parts: Mapping[str, Draft], strict: bool) -> None:
    """Report source logs with scenarios in several parts: a model would be tested on what it has seen."""
    schema = pa.schema({"scenario_id": pa.string(), "part": pa.int32()})
    drawn = (
        pa.record_batch([ids, pa.repeat(pa.scalar(number, pa.int32()), len(ids))], schema=schema)
        for number, draft in enumerate(parts.values())
        for ids in draft.ids()
    )
    reader = pa.RecordBatchReader.from_batches(schema, drawn)
    found = pool.lake.arrow(pool.query("splits/leaks"), drawn=reader)
    if not found.num_rows:
        return
    scenarios = pc.sum(found["num_scenarios"]).as_py()
    text = (
        f"this split leaks: {found.num_rows:,} source logs with {scenarios:,} scenarios stand in several parts, for "
        f"example {found['source_log'][0]}; `--by source_log` keeps the scenarios of a log together"
    )
    if strict:
        raise LeakingSplit(text)
    warnings.warn(text, LeakWarning, stacklevel=3)


def _lineage(pool: Pool, plan: Plan, part: str) -> Lineage:
    query = pool.query("operations/part", split=plan.query)
    return pool.lineage("split", query, plan.parameters | {"part": part})
