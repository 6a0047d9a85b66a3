"""The hard rules of ``sql/checks`` asked of rows in memory, before they are written: what breaks one stays out.

Each question is one query over all rules, because on so few rows DuckDB spends its time on planning. What
``ScenarioDescription.validate`` has looked at on the way here is not asked again.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import pyarrow as pa

from scenarionet_data.codec import Encoded
from scenarionet_data.errors import BrokenContract, InvalidScenario
from scenarionet_data.quality import rules
from scenarionet_data.query.engine import Engine
from scenarionet_data.schema import tables
from scenarionet_data.schema.package_data import SQL
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.files.opening import open_files
from scenarionet_data.storage.snapshots import snapshot as snapshots
from scenarionet_data.storage.snapshots.shard_record import ShardRecord

VALIDATED = frozenset(
    ("ego_is_valid_now", "headings_are_wrapped", "sizes_are_positive", "states_are_finite", "timestamps_increase")
)
"""Rules that no valid scenario breaks; ``check`` asks them of lakes, whoever wrote those."""

_GIVEN = ("metadata_rows", "tracks", "lights", "maps")


def audit(files: LakeFiles, scenarios: Sequence[Encoded]) -> dict[int, InvalidScenario]:
    """Scenarios that break a hard rule: position in the sequence to the rule and what breaks it.

    Lights above lanes of a shared map are not judged, because the map is not at hand.

    Args:
        files: The lake they are for.
        scenarios: Of one release of a dataset.
    """
    own = [s for s in scenarios if s.metadata["map_crop"] is None]
    rows = {
        "metadata_rows": pa.Table.from_pylist([dict(s.metadata) for s in scenarios], schema=_schema("metadata_rows")),
        "tracks": _table("tracks", [s.tracks for s in scenarios]),
        "lights": _table("lights", [s.lights for s in own]),
        "maps": _table("maps", [s.maps for s in own]),
    }
    release = scenarios[0].metadata["dataset"], scenarios[0].metadata["version"]
    found: dict[str, InvalidScenario] = {}
    for name, scenario_id, detail in _broken(files, rows, *release):
        found.setdefault(scenario_id, InvalidScenario(scenario_id, name, detail))
    numbers = {s.metadata["scenario_id"]: number for number, s in enumerate(scenarios)}
    return {numbers[scenario_id]: error for scenario_id, error in found.items()}


def audit_shared_map(files: LakeFiles, record: ShardRecord) -> None:
    """Ask the hard rules of a shared map that has been written and not committed yet.

    Raises:
        BrokenContract: It breaks one.
    """
    rows = {"maps": files.read(record.files[0], _schema("maps").names)}
    for name, _, detail in _broken(files, rows, record.dataset, record.version):
        raise BrokenContract(
            f"{detail} ({name}); every scenario there needs the map: mend the converter, or take it as it is with "
            "--no-check"
        )


def _broken(files: LakeFiles, rows: Mapping[str, pa.Table], dataset: str, version: str) -> list[tuple[str, str, str]]:
    """Rule, scenario id and detail of what breaks a rule, by rule."""
    given = {name: rows.get(name, _schema(name).empty_table()) for name in _GIVEN}
    for name, value in (("dataset", dataset), ("version", version)):  # in a lake, the names of folders
        given["maps"] = given["maps"].append_column(name, pa.repeat(value, given["maps"].num_rows))
    return _engine(str(files.root)).fetch(_query(), **given)


@cache
def _query() -> str:
    hard = [check for check in map(rules.load, rules.names()) if check.kind == "hard" and check.name not in VALIDATED]
    parts = [f"SELECT '{check.name}' AS name, scenario_id, detail FROM ({check.query})" for check in hard]
    return " UNION ALL ".join(parts) + " ORDER BY ALL"


@cache
def _engine(root: str) -> Engine:
    """One for each process and lake: opening it takes as long as a question. Workers are processes, so one thread."""
    return Engine(open_files(root), snapshots.EMPTY, given=_GIVEN, threads=1)


def _table(name: str, batches: Sequence[Any]) -> pa.Table:
    """The record batches of scenarios as one table; None where a scenario has no rows."""
    names = _schema(name).names
    return pa.Table.from_batches([batch.select(names) for batch in batches if batch is not None], _schema(name))


@cache
def _schema(name: str) -> pa.Schema:
    """The columns of a table that the rules may ask for: planning takes twice as long over all of them."""
    words = set(re.findall(r"\w+", _query()))
    for view in sorted(words):
        path = SQL / "views" / f"{view}.sql"
        words |= set(re.findall(r"\w+", path.read_text("utf-8"))) if path.is_file() else set()
    full = tables.load(name.removesuffix("_rows")).schema
    return pa.schema([field for field in full if field.name in words])
