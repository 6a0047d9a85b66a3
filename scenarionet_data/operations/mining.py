"""Keep moments in the lake: definitions are mined over the scenarios that they were not mined over yet, in batches."""

from __future__ import annotations

import hashlib
import json
import time
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from scenarionet_data import version
from scenarionet_data.databases.record import DatabaseRecord
from scenarionet_data.errors import BadParameter
from scenarionet_data.execution.progress import Progress
from scenarionet_data.operations import moments as composed
from scenarionet_data.operations.cautions import caution
from scenarionet_data.operations.moments import Moments
from scenarionet_data.query.lake_view import LakeView
from scenarionet_data.query.named_sql import EVENTS, RELATIONS
from scenarionet_data.query.views import dependencies
from scenarionet_data.schema import tables
from scenarionet_data.storage import kept_moments
from scenarionet_data.storage.kept_moments import KeptMoments
from scenarionet_data.storage.snapshots import manifests
from scenarionet_data.storage.snapshots import snapshot as snapshots

if TYPE_CHECKING:
    import polars as pl

    from scenarionet_data.operations.compiled_relations import CompiledRelations

MAX_STATES = 1_500_000
"""States of objects that are mined at once: their pairs and intermediate views take some hundred bytes each."""
_KEPT_WHOLE = 1000
"""Scenarios of a lake whose metadata are kept as a whole, so that one connection answers."""
_FLUSH_AFTER = 60.0
"""Seconds of work that are lost at most when mining is killed."""


@dataclass(frozen=True)
class Defined:
    """What is mined under a name.

    Attributes:
        moments: The composition, of each scenario by itself.
        parameters: Values that are written into it.
        doc: What it is.
    """

    moments: Moments
    parameters: dict[str, Any] = field(default_factory=dict)
    doc: str = ""

    def description(self) -> dict[str, Any]:
        """Return it for the lake, with the digest of all SQL that it consists of."""
        sha256 = hashlib.sha256(f"{self.moments.sql}\n{dependencies(self.moments.sql)}".encode()).hexdigest()
        made = {"created_at": snapshots.now(), "created_with": version.name_and_version()}
        return asdict(self) | {"sha256": sha256} | made


@dataclass(frozen=True)
class Mined:
    """What mining has added to a definition.

    Attributes:
        definition: Its name.
        version: Its version; a changed definition gets another one.
        scenarios: Scenarios that were mined now.
        moments: Moments that were found in them.
    """

    definition: str
    version: int
    scenarios: int
    moments: int


def defined(name: str, parameters: Mapping[str, str]) -> Defined:
    """Return what the name of an event or a relation stands for.

    Args:
        name: Name of its file; of an event where both have it (``following``).
        parameters: Values of its parameters as text; the others keep their defaults.

    Raises:
        UnknownEvent: There is neither.
        BadParameter: A parameter is unknown, or its text has another type.
    """
    is_relation = name in RELATIONS.names() and name not in EVENTS.names()
    named = (RELATIONS if is_relation else EVENTS).load(name)
    given = named.parse(parameters)
    found = composed.relation(name, given).lasting() if is_relation else composed.event(name, given)
    return Defined(found, named.bind(given), named.doc)


def kept_definitions(view: LakeView, name: str) -> dict[str, Defined]:
    """Return the definitions whose moments are kept under a name, as they were mined last.

    Raises:
        BadParameter: There are none.
    """
    found = {}
    for definition in view.files.folders(f"{kept_moments.FOLDER}/{name}"):
        newest = kept_moments.newest_version(view.files, name, definition)
        if newest:
            content, _ = newest.description()
            sql, roles, measures = (content["moments"][key] for key in ("sql", "roles", "measures"))
            moments = Moments(sql, tuple(roles), tuple(measures))
            found[definition] = Defined(moments, content["parameters"], content["doc"])
    if not found:
        have = ", ".join(view.files.folders(kept_moments.FOLDER)) or "none yet"
        raise BadParameter(f"{view.root}: no moments are kept under the name {name!r}; there are: {have}")
    return found


def keep_moments(
    view: LakeView,
    name: str,
    definitions: Mapping[str, Defined],
    database: DatabaseRecord | str | None = None,
    on_progress: Progress | None = None,
) -> list[Mined]:
    """Mine definitions over the scenarios that they were not mined over yet, and keep the moments under a name.

    Args:
        view: The lake; its snapshot's scenarios are mined.
        name: Name under which the moments are kept.
        definitions: What is mined, by name.
        database: Mine only its members.
        on_progress: Called after each batch with the number of scenarios.
    """
    from scenarionet_data.operations.compiled_relations import CompiledRelations  # here: few need the kernels

    view = view if database is None else view.restrict_to(database)
    kept = {each: kept_moments.claim(view.files, name, each, definitions[each].description()) for each in definitions}
    batches = list(_batches(view, kept))
    if batches:
        caution(
            view,
            "\n".join(each.moments.sql for each in definitions.values()),
            pa.concat_tables([wanted for _, wanted in batches]),
        )
    total, done = sum(len(wanted) for _, wanted in batches), 0
    waiting: dict[str, list[pa.Table]] = {each: [] for each in kept}
    mined, moments = dict.fromkeys(kept, 0), dict.fromkeys(kept, 0)
    flushed = time.monotonic()

    def flush() -> None:
        for each, rows in waiting.items():
            if rows:
                moments[each] += kept[each].publish(pa.concat_tables(rows))
                rows.clear()

    try:
        for missing, wanted in batches:
            part = view.restrict_to(wanted["scenario_id"].to_pylist()).keeping
            compiled = CompiledRelations(part)
            for each in missing:
                waiting[each].append(_find(compiled, kept[each], definitions[each], wanted))
                mined[each] += len(wanted)
            part.engine.close()
            done += len(wanted)
            if on_progress:
                on_progress(done, total, 0)
            if time.monotonic() - flushed > _FLUSH_AFTER:
                flush()
                flushed = time.monotonic()
    finally:
        flush()
    return [Mined(each, kept[each].version, mined[each], moments[each]) for each in kept]


def _batches(view: LakeView, kept: Mapping[str, KeptMoments]) -> Iterator[tuple[list[str], pa.Table]]:
    """Yield the definitions that some scenarios miss, and these scenarios, about MAX_STATES of states together."""
    columns = "scenario_id, content_hash, num_states, dt"
    scenarios = view.arrow(f"SELECT {columns} FROM metadata_rows ORDER BY scenario_id")
    missing = np.zeros((len(kept), len(scenarios)), np.bool_)
    for row, each in enumerate(kept.values()):
        left = scenarios.join(each.mined(), ["scenario_id", "content_hash"], join_type="left anti")["scenario_id"]
        missing[row] = pc.is_in(scenarios["scenario_id"], value_set=left.combine_chunks()).to_numpy()
    groups: dict[bytes, list[int]] = defaultdict(list)
    for scenario in np.flatnonzero(missing.any(axis=0)).tolist():
        groups[missing[:, scenario].tobytes()].append(scenario)
    names = np.array(list(kept), dtype=object)
    for rows in groups.values():
        wanted = scenarios.take(rows)
        for part in cut(wanted["num_states"].to_numpy()):
            yield names[missing[:, rows[0]]].tolist(), wanted.slice(part.start, part.stop - part.start)


def cut(sizes: Sequence[int] | np.ndarray[Any, Any], most: int | None = None) -> Iterator[slice]:
    """Yield slices of about so much (MAX_STATES by default) together; the last scenario of each may be beyond it."""
    batch = (np.cumsum(sizes) - sizes) // (most or MAX_STATES)
    edges = [0, *(np.flatnonzero(np.diff(batch)) + 1).tolist(), len(batch)]
    yield from (slice(start, stop) for start, stop in pairwise(edges) if stop > start)


def _find(part: CompiledRelations, kept: KeptMoments, definition: Defined, wanted: pa.Table) -> pa.Table:
    """Return the rows of ``moments`` of some scenarios; one without a moment has a row of nulls."""
    given = {"name": kept.name, "definition": kept.definition, "parameters": json.dumps(definition.parameters)}
    has = {*definition.moments.roles, *definition.moments.measures}
    extra = ", ".join(("" if each in has else "NULL AS ") + each for each in ("track_id", "other_id", "value"))
    spans = "first_timestep, last_timestep, begins, ends"
    sql = (
        f"SELECT $name AS name, $definition AS definition, {kept.version} AS definition_version, scenario_id, "
        f"content_hash, {spans}, {extra}, $parameters AS parameters\n"
        f"FROM wanted LEFT JOIN (\n{definition.moments.sql}\n) USING (scenario_id)"
    )
    schema = tables.load(kept_moments.FOLDER).schema
    return part.arrow(sql, given, tables={"wanted": wanted}).select(schema.names).cast(schema)


def find_moments(view: LakeView, found: Moments) -> pl.DataFrame:
    """Return all moments of a composition in order of scenario and time, mined in batches of scenarios."""
    import polars

    from scenarionet_data.operations.compiled_relations import CompiledRelations

    order = ", ".join(("scenario_id", "first_timestep", "last_timestep", *found.roles))
    sql = f"SELECT * FROM (\n{found.sql}\n) ORDER BY {order}"
    is_small = (pc.sum(manifests.column(view.files, view.snapshot, "num_scenarios")).as_py() or 0) <= _KEPT_WHOLE
    asked = view.keeping if is_small else view
    scenarios = asked.arrow("SELECT scenario_id, num_states, dt FROM metadata_rows ORDER BY scenario_id")
    caution(view, sql, scenarios)
    parts = list(cut(scenarios["num_states"].to_numpy()))
    if len(parts) < 2:
        return polars.DataFrame(CompiledRelations(view.keeping).arrow(sql))
    frames = []
    for part in parts:
        ids = scenarios["scenario_id"][part.start : part.stop].to_pylist()
        batch = view.restrict_to(ids).keeping
        frames.append(polars.DataFrame(CompiledRelations(batch).arrow(sql)))
        batch.engine.close()
    return polars.concat(frames)
