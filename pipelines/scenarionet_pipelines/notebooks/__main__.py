"""``make notebooks``: runs every notebook on generated scenarios and writes the pages in docs/notebooks."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import click

from scenarionet_pipelines.cli.progress import ProgressDisplay
from scenarionet_pipelines.notebooks import names
from scenarionet_pipelines.notebooks.execution import execute, make_example_lake
from scenarionet_pipelines.notebooks.rendering import render

PAGES = Path(__file__).parents[3] / "docs" / "notebooks"


def main(chosen: list[str]) -> None:
    """Render these notebooks, or all of them."""
    with tempfile.TemporaryDirectory() as folder, ProgressDisplay("notebooks", "notebook") as progress:
        make_example_lake(Path(folder))
        wanted = chosen or names()
        for number, name in enumerate(wanted):
            progress.update(number, len(wanted), 0)
            page = render(execute(name, Path(folder)), name, PAGES, Path(folder))
            click.echo(page)


if __name__ == "__main__":
    main(sys.argv[1:])
