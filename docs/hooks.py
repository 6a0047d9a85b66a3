"""Hooks of mkdocs and griffe: fill the pages of the reference that are generated when the site is built.

A page asks for generated content with a line ``<!-- generated: NAME -->``; ``GENERATORS`` has a function per name. The
text comes from the installed packages: the click commands, the SQL files with their headers, and the views of a lake.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
import griffe

from scenarionet_data import Lake
from scenarionet_data.quality import rules
from scenarionet_data.query import named_sql
from scenarionet_data.schema.package_data import SQL
from scenarionet_pipelines.cli.group import find_verb
from scenarionet_pipelines.verb_tree import GROUPS, SECTIONS


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Replace each mark of a page by the text that it asks for."""
    return re.sub(r"<!-- generated: (\w+) -->", lambda mark: "\n".join(GENERATORS[mark[1]]()), markdown)


class CodeExamples(griffe.Extension):
    """Render the examples of docstrings as code: Google style leaves them unmarked, and griffe takes them for prose."""

    def on_object(self, *, obj: griffe.Object, **_: Any) -> None:
        """Put a fence around the body of an ``Example:`` section that is not a doctest."""
        if obj.docstring:
            obj.docstring.value = re.sub(
                r"^Example:\n((?:(?: {4}.*)?(?:\n|\Z))+)", _fenced, obj.docstring.value, flags=re.MULTILINE
            )


def _fenced(example: re.Match[str]) -> str:
    body = example[1].strip("\n")
    return example[0] if ">>>" in body else f"Example:\n    ```python\n{body}\n    ```\n"


def command_line() -> Iterator[str]:
    """Every verb by section: usage, description, arguments, options, examples."""
    groups = {
        f"Group `{name}`": (group.doc, [f"{name} {verb}" for verb in group.verbs]) for name, group in GROUPS.items()
    }
    for section, (doc, names) in ({title: ("", verbs) for title, verbs in SECTIONS.items()} | groups).items():
        yield f"\n## {section}\n\n{doc}\n"
        for name in names:
            verb = find_verb(name)
            context = click.Context(verb, info_name=f"scenarionet {name}")
            yield f"\n### `{name}`\n"
            yield f"```text\n{' '.join([context.command_path, *verb.collect_usage_pieces(context)])}\n```\n"
            yield _paragraphs(verb.help or "")
            if options := [
                record
                for option in verb.params
                if isinstance(option, click.Option) and (record := option.get_help_record(context))
            ]:
                yield "| option | meaning |\n| --- | --- |"
                yield from (f"| `{_cell(flags)}` | {_cell(help_text)} |" for flags, help_text in options)
            yield "\n```sh\n" + "\n".join(getattr(verb, "examples", ())) + "\n```\n"


def views() -> Iterator[str]:
    """Every view: what a row is, and its columns with their types in DuckDB."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "snapshots").mkdir()
        lake = Lake(folder)
        for path in sorted((SQL / "views").glob("*.sql")):
            text = path.read_text("utf-8")
            yield f"\n## `{path.stem}`\n"
            yield _header(text)
            columns = lake.arrow(f"SELECT * FROM {path.stem}")
            yield "\n| column | type |\n| --- | --- |"
            yield from (f"| `{field.name}` | {_cell(str(field.type))} |" for field in columns.schema)
            yield _source(path.name, text)
    yield "\n# Macros\n"
    for path in sorted((SQL / "macros").glob("*.sql")):
        text = path.read_text("utf-8")
        signature = re.search(r"MACRO (\w+\([^)]*\))", text)
        yield f"\n## `{signature[1] if signature else path.stem}`\n"
        yield _header(text)
        yield _source(path.name, text)


def events() -> Iterator[str]:
    """Every event: definition, source, parameters, SQL."""
    yield from _named(named_sql.EVENTS)


def filters() -> Iterator[str]:
    """Every named filter: meaning, parameters, SQL."""
    yield from _named(named_sql.FILTERS)


def checks() -> Iterator[str]:
    """Every rule by kind, with its SQL."""
    for check in map(rules.load, rules.names()):
        yield f"\n## `{check.name}`\n\n**{check.kind}** — {check.doc}\n"
        yield _source(f"{check.name}.sql", (SQL / "checks" / f"{check.name}.sql").read_text("utf-8"))


def notebook_pictures() -> Iterator[str]:
    """The pictures of every notebook's page, below a link to it."""
    for page in sorted(Path(__file__).parent.glob("notebooks/*.md")):
        text = page.read_text("utf-8")
        title = re.search(r"^# (.*)$", text, re.MULTILINE)
        yield f"\n### {title[1] if title else page.stem}\n\n[Notebook](notebooks/{page.name})\n"
        yield from (f"![{alt}](notebooks/{name})\n" for alt, name in re.findall(r"!\[([^\]]*)\]\(([^)]+)\)", text))


def _named(folder: named_sql.Folder) -> Iterator[str]:
    for name in folder.names():
        found = folder.load(name)
        text = (SQL / folder.name / f"{name}.sql").read_text("utf-8")
        meaning, _, source = _header(text).partition("Source: ")
        yield f"\n## `{name}`\n\n{meaning.strip()}\n"
        if source:
            yield f"*Source: {source}*\n"
        if found.defaults:
            yield "| parameter | default |\n| --- | --- |"
            yield from (f"| `{key}` | `{value}` |" for key, value in found.defaults.items())
        yield _source(f"{name}.sql", text)


def _header(text: str) -> str:
    """The comment at the head of an SQL file as prose, without its ``needs`` and parameters."""
    lines = []
    for line in text.splitlines():
        if not line.startswith("--"):
            break
        comment = line.removeprefix("--").strip()
        if not comment.startswith("needs: ") and not re.fullmatch(r"\w+ = .+", comment):
            lines.append(comment)
    return " ".join(lines)


def _source(name: str, text: str) -> str:
    body = "\n".join(f"    {line}" for line in text.strip().splitlines())
    return f'\n??? note "{name}"\n\n    ```sql\n{body}\n    ```\n'


def _paragraphs(text: str) -> str:
    """Help text as Markdown: click marks preformatted blocks with a backspace character."""
    parts = []
    for part in re.split(r"\n\s*\n", text):
        if part.lstrip().startswith("\b"):
            parts.append("```text\n" + "\n".join(part.splitlines()[1:]) + "\n```")
        else:
            parts.append(" ".join(part.split()))
    return "\n\n".join(parts) + "\n"


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("<", "&lt;").replace("\n", " ")


GENERATORS = {
    "command_line": command_line,
    "views": views,
    "events": events,
    "filters": filters,
    "checks": checks,
    "notebook_pictures": notebook_pictures,
}
