"""``scenarionet info filters``: list the named filters and the columns of conditions."""

from __future__ import annotations

from typing import Any

import click

from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.output import print_json
from scenarionet_pipelines.cli.parameters import json_option


@verb("filters", "scenarionet info filters", "scenarionet info filters --columns")
@click.option("--columns", is_flag=True, help="List the columns of metadata instead, with units and descriptions.")
@json_option
def command(columns: bool, as_json: bool) -> None:
    """List the named filters, or the columns that conditions can use."""
    if columns:
        _list_columns(as_json)
    else:
        _list_filters(as_json)


def _list_filters(as_json: bool) -> None:
    from scenarionet_data.query.named_sql import FILTERS

    found = [FILTERS.load(name) for name in FILTERS.names()]
    if as_json:
        print_json({"filters": [{"name": f.name, "doc": f.doc, "parameters": f.defaults} for f in found]})
        return
    for each in found:
        parameters = ",".join(f"{key}={_as_typed(value)}" for key, value in each.defaults.items())
        click.echo(f"{each.name}:{parameters}" if parameters else each.name)
        click.echo(f"    {each.doc}")


def _as_typed(value: Any) -> str:
    """A default as it would be typed."""
    return f"{value:g}" if isinstance(value, (int, float)) else " ".join(value) if isinstance(value, list) else value


def _list_columns(as_json: bool) -> None:
    from scenarionet_data.schema import tables
    from scenarionet_data.storage.read.metadata_rows import ADDRESS_COLUMNS

    metadata = tables.load("metadata")
    columns = [c for c in (*metadata.columns, *metadata.derived) if c.name not in ADDRESS_COLUMNS]
    if as_json:
        print_json({"columns": [{"name": c.name, "type": c.type, "unit": c.unit, "doc": c.doc} for c in columns]})
        return
    for column in columns:
        unit = f" [{column.unit}]" if column.unit else ""
        click.echo(f"{column.name}{unit}\n    {column.doc}")
