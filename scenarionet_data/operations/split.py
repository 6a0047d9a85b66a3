"""Splits: each scenario gets a share of [0, 1) or a named part; parts are disjoint and cover all scenarios."""

from __future__ import annotations

import re
import warnings
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass
from fractions import Fraction
from itertools import accumulate
from math import ceil
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc

from scenarionet_data.arrays.dtypes import UInt8
from scenarionet_data.databases import record as records
from scenarionet_data.databases import writer
from scenarionet_data.databases.record import DatabaseRecord
from scenarionet_data.databases.writer import DatabaseWriter
from scenarionet_data.errors import BadParameter, EmptyResult, LakeError, LeakingSplit
from scenarionet_data.operations.database_query import (
    AnyDatabase,
    DatabaseQuery,
    Pool,
    check_column,
    check_whole,
    uniform,
)

_MAX_PARTS = 100


class LeakWarning(UserWarning):
    """Several parts of a split have scenarios of the same source log.

    Args:
        message: The warning, with its remedy for Python.
        cli_remedy: Option with the same effect as the remedy.
    """

    def __init__(self, message: str, cli_remedy: str = "") -> None:
        super().__init__(message)
        self.cli_remedy = cli_remedy


@dataclass(frozen=True)
class _Parts:
    """The query of a split.

    Attributes:
        sql: Selects scenario_id, weight, content_hash and ``part`` of every scenario.
        parameters: Parameters of the query.
        names: Name of the database of each part.
    """

    sql: str
    parameters: dict[str, Any]
    names: dict[str, str]


class Splitting(Pool[AnyDatabase]):
    """The verb ``split`` of lakes and databases."""

    def split(
        self,
        database: DatabaseRecord | str | Mapping[str, float] | None = None,
        fractions: Mapping[str, float] | None = None,
        *,
        name: str | None = None,
        seed: int = 0,
        by: str = "scenario_id",
        stratify: str | None = None,
        along: str | None = None,
        levels: int | None = None,
        each: str | None = None,
        strict: bool = False,
        replace: bool = False,
        allow_empty: bool = False,
    ) -> dict[str, AnyDatabase]:
        """Split a database by fractions, into levels, or by the values of a column, and save the parts.

        By fractions alone, the part of a scenario (or group, for example ``by="source_log"``) depends on a hash of its
        id and the seed, so that it stays the same as the lake grows, and on all machines. ``stratify`` gives every part
        its fraction of each value of a column, and ``along`` splits in the order of a column, for example a date: both
        depend on all scenarios, and change as the lake grows.

        Args:
            database: Database to split; by default all scenarios of the lake, or the members of this database.
            fractions: Fraction of each part by its name; they add up to 1. May be given in place of ``database``.
            name: Parts are saved as ``<name>_<part>``; by default the name of the database, or ``all``.
            seed: Another seed gives another split.
            by: Column whose equal values stay together.
            stratify: Column whose values are each split by the fractions.
            along: Column whose order the parts follow; equal values stay together.
            levels: Instead of fractions: number of parts ``level1``, ... of equal size in the order of ``along``
                (difficulty by default).
            each: Instead of fractions: column with one part for each value.
            strict: Raise for a split that leaks, instead of a warning.
            replace: Add a version to parts that exist.
            allow_empty: Save parts without members, too.

        Raises:
            BadParameter: Fractions do not add up to 1, a column does not exist, or arguments exclude each other.
            LeakingSplit: Several parts have scenarios of one source log, and ``strict`` is True.
            DatabaseExists, EmptyResult: See :meth:`filter`; no part is saved.
        """
        if isinstance(database, Mapping):
            if fractions is not None:
                raise BadParameter("fractions are given twice: wanted split(database, fractions) or split(fractions)")
            database, fractions = None, database
        if not isinstance(fractions, Mapping | None) or not all(isinstance(part, str) for part in fractions or ()):
            raise BadParameter(
                f"fractions: wanted those of parts by name, such as {{'train': 0.9, 'val': 0.1}}, found {fractions!r}"
            )
        if [fractions is not None, levels is not None, each is not None].count(True) != 1:
            raise BadParameter(
                'wanted one of fractions ({"train": 0.9, "val": 0.1}), a number of levels, or each=column'
            )
        if stratify is not None and (along is not None or fractions is None):
            raise BadParameter("stratify goes with fractions alone: not with along, levels or each")
        if each is not None and along is not None:
            raise BadParameter("each makes a part for every value, without order: leave along out")
        check_whole("levels", levels, 1)
        check_whole("seed", seed)
        query = self._query(database)
        stem = name or (query.parents[0].name if query.parents else "all")
        if stem is None:
            raise BadParameter("an unsaved selection has no name: give the parts one, with name=...")
        if each is not None:
            parts = _by_value(query, each, stem)
        else:
            if levels is not None:
                fractions = {f"level{number}": 1.0 / levels for number in range(1, levels + 1)}
                along = along or "difficulty"
            parts = _by_share(query, fractions or {}, seed, by, stratify, along, levels is not None, stem)
        for part_name in parts.names.values():
            records.check_free(query.view.files, part_name, replace=replace)
        with writer.database_writers(query.view.files, parts.names) as writers:
            # A number instead of a name for each scenario saves a fifth of the time.
            shares = {f"part_{k}": k + 1 for k in range(len(parts.names)) if f"part_{k}" in parts.parameters}
            numbers = query.parts(parts.sql, parts.parameters | shares, [*parts.names])
            if numbers is not None:
                for number, part_writer in enumerate(writers.values(), 1):
                    part_writer.add(query.rows[0].where(numbers == number))
            else:
                with closing(query.batches(parts.sql, parts.parameters)) as batches:
                    for rows in batches:
                        for part, part_writer in writers.items():
                            part_writer.add(writer.rows_of_part(rows, part))
            _check_counts(query, {part: part_writer.count for part, part_writer in writers.items()}, allow_empty)
            one_part = query.query("operations/part", {"split": parts.sql})
            for part, part_writer in writers.items():
                part_writer.finish(query.lineage("split", one_part, parts.parameters | {"part": part}))
            if fractions is not None and levels is None and by != "source_log":
                _check_leaks(query, writers, numbers, strict)
            saved = {part: done.publish(parts.names[part], replace=replace) for part, done in writers.items()}
        return {part: self._handle(record) for part, record in saved.items()}


def _by_share(
    query: DatabaseQuery,
    fractions: Mapping[str, float],
    seed: int,
    by: str,
    stratify: str | None,
    along: str | None,
    is_levels: bool,
    stem: str,
) -> _Parts:
    """Split at bounds in [0, 1)."""
    bounds = upper_bounds(fractions)
    for column, purpose in ((by, "to split by"), (stratify, "to stratify by"), (along, "to split along")):
        if column is not None:
            check_column(query.view, column, purpose)
    if along is not None:
        unknown = query.run(
            query.query("operations/filter", {"conditions": f'"{along}" IS NULL', "ranking": "place"}), {}
        ).num_rows
        if unknown:
            raise BadParameter(
                f'{unknown:,} of {len(query):,} scenarios have no {along}: filter by "{along} IS NOT NULL" first'
            )
    method = "stratified" if stratify else "levels" if is_levels else "along" if along else "by_hash"
    fields = {
        "by": by,
        "stratify": stratify or "",
        "along": along or "",
        "drawn_group": uniform("split_group"),
        "drawn_stratum": uniform("'stratum:' || coalesce(stratum, '')"),
    }
    if method == "by_hash" and by == "scenario_id":
        fields["pool"] = query.keys  # no other column is needed: half the time
    shares = query.query(f"splits/{method}", fields)
    cases = [f"WHEN share < $upper_{number} THEN $part_{number}" for number in range(len(bounds))]
    sql = query.query("operations/split", {"shares": shares, "cases": " ".join(cases)})
    parameters: dict[str, Any] = {f"part_{number}": part for number, part in enumerate(fractions)}
    uppers = map(as_hexadecimal, bounds) if method == "by_hash" else bounds
    parameters |= {f"upper_{number}": upper for number, upper in enumerate(uppers)}
    if along is None:
        parameters |= {"seed": seed}
    return _Parts(sql, parameters, {part: f"{stem}_{part}" for part in fractions})


def _by_value(query: DatabaseQuery, column: str, stem: str) -> _Parts:
    """Split into one part for every value of a column; characters that are not allowed in names become ``_``."""
    check_column(query.view, column, "to split by")
    sql = query.query("splits/each", {"each": column})
    found = query.run(f"SELECT part FROM ({sql}) GROUP BY part ORDER BY part LIMIT {_MAX_PARTS + 1}", {})
    values: list[str] = found["part"].to_pylist()
    if len(values) > _MAX_PARTS:
        raise BadParameter(f"{column} has more than {_MAX_PARTS} values: too many for a database each")
    names = {value: f"{stem}_{re.sub(r'[^A-Za-z0-9._-]', '_', value)}" for value in values}
    if len(set(names.values())) < len(names):
        raise BadParameter(f"two values of {column} would get the same name: filter by it instead")
    return _Parts(sql, {}, names)


def upper_bounds(fractions: Mapping[str, float]) -> list[float]:
    """Return the upper bound of each part of a split in [0, 1].

    Raises:
        BadParameter: A fraction is not above 0, or they do not add up to 1.
    """
    if not fractions or not all(isinstance(each, int | float) and 0 < each <= 1 + 1e-6 for each in fractions.values()):
        raise BadParameter('wanted at least one part, each with a fraction above 0, as in {"train": 0.9, "val": 0.1}')
    exact = [Fraction(repr(float(fraction))) for fraction in fractions.values()]  # 0.2 + 0.2 + 0.2 is 0.6
    total = sum(exact, Fraction())
    if abs(float(total) - 1) > 1e-6:
        raise BadParameter(f"expected fractions that add up to 1, found {float(total):g}")
    return [float(upper / total) for upper in accumulate(exact)]


def as_hexadecimal(bound: float) -> str:
    """Return the text that the hexadecimal MD5 is below if its first 52 bits, as a part of 2^52, are below a bound."""
    first_bits = ceil(bound * 2**52)  # exact
    return f"{first_bits:013x}" if first_bits < 2**52 else "g"  # behind all digits


def _check_counts(query: DatabaseQuery, counts: Mapping[str, int], allow_empty: bool) -> None:
    """Raise unless every scenario is in one part, and no part is empty."""
    total = sum(counts.values())
    if total != len(query):
        raise LakeError(f"{total:,} of {len(query):,} scenarios fell into a part: run `scenarionet maintain check`")
    empty = [part for part, count in counts.items() if not count]
    if empty and not allow_empty:
        raise EmptyResult(
            f"no scenario of {len(query):,} falls into {', '.join(empty)}; "
            "other fractions, another seed, or allow_empty=True",
            cli_remedy="--allow-empty",
        )


def _check_leaks(
    query: DatabaseQuery, parts: Mapping[str, DatabaseWriter], numbers: UInt8 | None, strict: bool
) -> None:
    """Report source logs with scenarios in several parts: a model would be tested on data it was trained on."""
    if numbers is not None:
        source, drawn = "drawn POSITIONAL JOIN metadata_rows", pa.table({"part": numbers})
    else:
        schema = pa.schema({"scenario_id": pa.string(), "part": pa.int32()})
        batches = (
            pa.record_batch([ids, pa.repeat(pa.scalar(number, pa.int32()), len(ids))], schema=schema)
            for number, part in enumerate(parts.values(), 1)
            for ids in part.ids()
        )
        source = "drawn JOIN metadata_rows USING (scenario_id)"
        drawn = pa.RecordBatchReader.from_batches(schema, batches)
    found = query.view.engine.arrow(query.query("splits/leaks", {"drawn": source}), tables={"drawn": drawn})
    if not found.num_rows:
        return
    scenarios = pc.sum(found["num_scenarios"]).as_py()
    text = (
        f"this split leaks: {found.num_rows:,} source logs with {scenarios:,} scenarios are in several parts, "
        f'for example {found["source_log"][0]}; by="source_log" keeps the scenarios of a log together'
    )
    if strict:
        raise LeakingSplit(text, cli_remedy="--by source_log")
    warnings.warn(LeakWarning(text, cli_remedy="--by source_log"), stacklevel=3)
