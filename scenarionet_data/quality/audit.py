"""Checks the hard rules of ``sql/checks`` on rows in memory before they are written; violating scenarios are left out.

All rules run as one query, because DuckDB spends most of the time on planning for so few rows. Rules that
``ScenarioDescription.validate`` has checked already are left out.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import pyarrow as pa

from scenarionet_data.codec import Encoded
from scenarionet_data.errors import BrokenContract, InvalidScenario
from scenarionet_data.quality import rules
from scenarionet_data.query.engine import Engine
from scenarionet_data.query.views import dependencies
from scenarionet_data.schema import tables
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.files.places import open_files
from scenarionet_data.storage.snapshots import snapshot as snapshots
from scenarionet_data.storage.snapshots.shard_record import ShardRecord

VALIDATED = frozenset(
    ("ego_is_valid_now", "headings_are_wrapped", "sizes_are_positive", "states_are_finite", "timestamps_increase")
)
"""Rules that no valid scenario violates; checks of lakes include them, as other software may have written a lake."""

_GIVEN = ("metadata_rows", "tracks", "lights", "maps")
_RULES_OF = {"lights": "lights_refer_to_lanes", "maps": "lane_links_are_mutual"}
"""The rule that nothing violates while a table has no rows: planning it takes milliseconds."""


def audit(scenarios: Sequence[Encoded]) -> dict[int, InvalidScenario]:
    """Return the scenarios that violate a hard rule: the error by index in the sequence.

    Lights above lanes of a shared map are not checked, because the map is not loaded.

    Args:
        scenarios: Scenarios of one release of a dataset.
    """
    parts: dict[str, list[Any]] = {"tracks": [], "lights": [], "maps": []}
    numbers, metadata = {}, []
    for number, scenario in enumerate(scenarios):
        numbers[scenario.metadata["scenario_id"]] = number
        metadata.append(dict(scenario.metadata))
        parts["tracks"].append(scenario.tracks)
        if scenario.metadata["map_crop"] is None:
            parts["lights"].append(scenario.lights)
            parts["maps"].append(scenario.maps)
    rows = {"metadata_rows": pa.Table.from_pylist(metadata, schema=_schema("metadata_rows"))}
    for name, batches in parts.items():  # a scenario without rows has None
        schema = _schema(name)
        rows[name] = pa.Table.from_batches([each.select(schema.names) for each in batches if each is not None], schema)
    found: dict[int, InvalidScenario] = {}
    for name, scenario_id, detail in _broken(rows, metadata[0]["dataset"], metadata[0]["version"]):
        found.setdefault(numbers[scenario_id], InvalidScenario(scenario_id, name, detail))
    return found


def audit_shared_map(files: LakeFiles, record: ShardRecord) -> None:
    """Check the hard rules on a shared map that is written, but not committed yet.

    Raises:
        BrokenContract: It violates one.
    """
    rows = {"maps": files.read(record.files[0], _schema("maps").names)}
    for name, _, detail in _broken(rows, record.dataset, record.version):
        raise BrokenContract(
            f"{detail} ({name}); all its scenarios need the map: fix the converter, or convert with check=False",
            cli_remedy="--no-check",
        )


def _broken(rows: Mapping[str, pa.Table], dataset: str, version: str) -> list[tuple[str, str, str]]:
    """Return rule, scenario id and detail of all violations, by rule."""
    given = {name: rows[name] if name in rows else _schema(name).empty_table() for name in _GIVEN}
    for name, value in (("dataset", dataset), ("version", version)):  # names of folders in a lake
        given["maps"] = given["maps"].append_column(name, pa.repeat(value, given["maps"].num_rows))
    without = VALIDATED
    for table, rule in _RULES_OF.items():
        if not given[table].num_rows:
            without |= {rule}
    return _engine().fetch(_query(without), given)


@cache
def _query(without: frozenset[str]) -> str:
    hard = [check for check in map(rules.load, rules.names()) if check.kind == "hard" and check.name not in without]
    parts = [f"SELECT '{check.name}' AS name, scenario_id, detail FROM ({check.query})" for check in hard]
    return " UNION ALL ".join(parts) + " ORDER BY ALL"


@cache
def _engine() -> Engine:
    """Return an engine that is only given rows, and reads no files: its folder does not matter.

    Cached per process, as opening DuckDB costs as much as a query. Single-threaded: workers are processes.
    """
    return Engine(open_files(tempfile.gettempdir()), snapshots.EMPTY, given=_GIVEN, threads=1)


@cache
def _schema(name: str) -> pa.Schema:
    """Return the columns of a table that the rules may use: planning takes twice as long with all columns."""
    words = set(re.findall(r"\w+", _query(VALIDATED) + dependencies(_query(VALIDATED))))
    full = tables.load(name.removesuffix("_rows")).schema
    return pa.schema([field for field in full if field.name in words])
