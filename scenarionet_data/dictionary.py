"""The data dictionary in Markdown, made from the contract: ``python -m scenarionet_data.dictionary``."""

from __future__ import annotations

from scenarionet_data import tables
from scenarionet_data.tables import Column, Table


def markdown() -> str:
    """Every table of the contract with every column, its type, unit and meaning."""
    parts = [
        "# Data dictionary",
        "",
        "Made from `schemas/*.toml` by `make docs`; edit those. SI units; headings in radians, counter-clockwise",
        "from +x, in [-π, π); the scenario frame is the source's, moved near the ego and never turned.",
        "",
    ]
    for name in tables.TABLES:
        parts += [section(tables.load(name)), ""]
    return "\n".join(parts).rstrip() + "\n"


def section(table: Table) -> str:
    """One table as a heading, a sentence and rows of columns."""
    rows = [f"## {table.name} (version {table.version})", "", table.doc, "", "| column | type | unit | meaning |"]
    rows.append("| --- | --- | --- | --- |")
    rows += [_row(column) for column in (*table.columns, *table.derived)]
    return "\n".join(rows)


def _row(column: Column) -> str:
    kind = column.type.replace("dictionary", "string") + (" or null" if column.nullable else "")
    meaning = column.doc.replace("|", "\\|").replace("<", "&lt;")
    if column.sql:
        meaning += f" Computed in the view: `{column.sql}`."
    return f"| `{column.name}` | {kind} | {column.unit} | {meaning} |"


if __name__ == "__main__":
    print(markdown(), end="")  # noqa: T201
