"""The data dictionary: the schema of every table as a Markdown page."""

from __future__ import annotations

from scenarionet_data.schema import tables
from scenarionet_data.schema.package_data import SCHEMAS
from scenarionet_data.schema.tables import Column, Table

_HEAD = ("| column | type | unit | meaning |", "| --- | --- | --- | --- |")


def markdown() -> str:
    """Return the page: every table with its columns, their types, units and meanings."""
    parts = [
        "# Tables",
        "",
        "Generated from `schemas/*.toml` by `make docs`; edit those files. Units are SI. Headings are radians,",
        "counter-clockwise from +x, in [-π, π). The scenario frame is the source frame moved near the ego, never",
        "rotated. Queries read these tables as [views](views.md) of the same names.",
        "",
    ]
    for name in tables.TABLES:
        parts += [section(tables.load(name)), ""]
    return "\n".join(parts).rstrip() + "\n"


def section(table: Table) -> str:
    """Return one table as a heading, its description and a row per column, metrics grouped by their owners."""
    parts, columns = [f"## {table.name} (version {table.version})", "", table.doc], (*table.columns, *table.derived)
    for owner in dict.fromkeys(column.owner for column in columns):
        parts += ["", *([f"Metrics of {owner}:", ""] if owner else []), *_HEAD]
        parts += [_row(column) for column in columns if column.owner == owner]
    return "\n".join(parts)


def _row(column: Column) -> str:
    kind = column.type.replace("dictionary", "string") + (" or null" if column.nullable else "")
    meaning = column.doc.replace("|", "\\|").replace("<", "&lt;")
    if column.better:
        meaning += f" {column.better.capitalize()} is better."
    if column.since > 1:
        meaning += f" Since version {column.since}; null in older files."
    if column.sql:
        meaning += f" Computed in the view: `{column.sql}`."
    return f"| `{column.name}` | {kind} | {column.unit} | {meaning} |"


def main() -> None:
    """Write the dictionary's page; ``make docs`` in a checkout."""
    (SCHEMAS.parent / "docs" / "reference" / "data_dictionary.md").write_text(markdown(), "utf-8")


if __name__ == "__main__":
    main()
