"""The card of a pack, ``README.md``: its tables as configurations of Hugging Face's ``datasets``, and its licences.

Format: https://huggingface.co/docs/hub/datasets-manual-configuration.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable

import pyarrow as pa
import pyarrow.compute as pc

from scenarionet_data.errors import BadParameter

CARD = "README.md"
_TABLES = ("metadata", "tracks", "lights", "maps")
_SPLIT = re.compile(r"/split=([^/]+)/")
_NAMES = {"CC BY-NC-SA 4.0": "cc-by-nc-sa-4.0", "Apache-2.0 (generated)": "apache-2.0", "CC0": "cc0-1.0"}
"""Names of licences on Hugging Face."""
_ALLOWS_REDISTRIBUTION = re.compile(r"(CC0|CC[ -]BY(-NC)?(-SA)?[ -]|Apache-2\.0|MIT|ODbL)", re.IGNORECASE)


def check_publishable(reference: str, rows: pa.Table) -> None:
    """Raise if a licence of some scenarios is not known to allow their redistribution.

    Args:
        reference: Name of the database.
        rows: Their rows of the metadata table.

    Raises:
        BadParameter: The message names the licence and the remedy.
    """
    for licence, count in _licences(rows):
        if not _ALLOWS_REDISTRIBUTION.match(licence):
            example = rows.filter(pc.equal(rows["licence"].cast(pa.string()), licence))["scenario_id"][0]
            raise BadParameter(
                f"{reference}: the licence {licence!r} of {count:,} scenarios, for example {example}, is not known "
                "to allow redistribution; filter them out with \"licence LIKE 'CC %'\", or pack without publishable"
            )


def make_card(reference: str, rows: pa.Table, files: Iterable[str]) -> str:
    """Text of the card.

    Args:
        reference: ``name@version`` of the database.
        rows: Metadata rows of its members.
        files: Names of the pack's files.
    """
    licences = _licences(rows)
    known = [_NAMES.get(licence, "other") for licence, _ in licences]
    name = known[0] if len(set(known)) == 1 else "other"
    lines = ["---", f"license: {name}", "configs:"]
    names = sorted(files)
    for table in _TABLES:
        lines += _configuration(table, [each for each in names if each.startswith(f"{table}/")])
    counted = "\n".join(f"| {licence} | {count:,} |" for licence, count in licences)
    lines += [
        "---",
        "",
        f"# {reference.partition('@')[0]}",
        "",
        f"{rows.num_rows:,} traffic scenarios (database `{reference}`), a lake of ScenarioNet: open the folder with",
        '`scenarionet_data.Lake("folder")`, or its tables with `datasets.load_dataset("folder", "metadata")`.',
        "Recordings keep the licence of their dataset, which the column `licence` of `metadata` has, too.",
        "",
        "| licence | scenarios |",
        "| --- | --- |",
        counted,
        "",
    ]
    return "\n".join(lines)


def _configuration(table: str, files: list[str]) -> list[str]:
    """YAML of a table's configuration: its files by split."""
    if not files:
        return []
    splits = sorted({match[1] for name in files if (match := _SPLIT.search(name))})
    paths = {re.sub(r"\W", "_", split): f"{table}/**/split={split}/*.parquet" for split in splits}
    paths = paths or {"train": f"{table}/**/*.parquet"}
    listed = [
        line for split, path in paths.items() for line in (f"  - split: {split}", f"    path: {json.dumps(path)}")
    ]
    return [f"- config_name: {table}", *(["  default: true"] if table == "metadata" else []), "  data_files:", *listed]


def _licences(rows: pa.Table) -> list[tuple[str, int]]:
    """Licences with their number of scenarios, sorted."""
    counts = pc.value_counts(rows["licence"].cast(pa.string()).combine_chunks())
    return sorted((str(each["values"]), each["counts"].as_py()) for each in counts)
