"""Write tables as Parquet, CSV or JSON, depending on the file name's suffix."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import click

from scenarionet_data.errors import BadParameter
from scenarionet_data.storage.files.places import local_path
from scenarionet_pipelines.cli.output import count

if TYPE_CHECKING:
    import polars as pl

_SUFFIXES = (".parquet", ".csv", ".json")


def check_suffix(path: str, option: str) -> None:
    """Raise for an unsupported suffix or a URL, before anything is computed.

    Raises:
        BadParameter: The message lists the supported suffixes.
    """
    local_path(path, "a table")
    if Path(path).suffix not in _SUFFIXES:
        raise BadParameter(f"{option} {path}: the file name has to end in {', '.join(_SUFFIXES)}")


def write_table(rows: pl.DataFrame, path: str) -> None:
    """Write rows to a file in the format of its suffix, and say how many."""
    suffix = Path(path).suffix
    if suffix == ".parquet":
        rows.write_parquet(path)
    elif suffix == ".csv":
        flat(rows).write_csv(path)
    else:
        rows.write_json(path)
    click.echo(f"{count(len(rows), 'row')} in {path}", err=True)


def flat(rows: pl.DataFrame) -> pl.DataFrame:
    """Convert lists and structs to JSON text, because CSV has no nested values."""
    import polars as pl

    nested = [name for name, kind in rows.schema.items() if kind.is_nested()]
    return rows.with_columns(pl.Series(name, [json.dumps(v) for v in rows[name].to_list()]) for name in nested)
