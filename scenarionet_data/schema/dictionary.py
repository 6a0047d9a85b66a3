"""The data dictionary in Markdown, made from the contract."""

from __future__ import annotations

from scenarionet_data.schema import tables
from scenarionet_data.schema.package_data import SCHEMAS
from scenarionet_data.schema.tables import Column, Table

_BEGIN, _END = "<!-- metadata: made by `make docs` -->", "<!-- end -->"


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


def into_page(page: str) -> str:
    """A page with its list of metadata columns brought up to date, between the two marks."""
    before, _, rest = page.partition(_BEGIN)
    _, _, after = rest.partition(_END)
    rows = "\n".join(section(tables.load("metadata")).splitlines()[4:])
    return f"{before}{_BEGIN}\n{rows}\n{_END}{after}"


def main() -> None:
    """Write the dictionary and the README's list; for `make docs`, in a checkout."""
    root = SCHEMAS.parent
    (root / "docs" / "reference" / "data_dictionary.md").write_text(markdown(), "utf-8")
    readme = root / "README.md"
    readme.write_text(into_page(readme.read_text("utf-8")), "utf-8")


if __name__ == "__main__":
    main()
