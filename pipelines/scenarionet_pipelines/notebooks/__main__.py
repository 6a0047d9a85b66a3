"""``make notebooks``: runs every notebook on generated scenarios and writes the pages in docs/notebooks.

``ARGS='testing --folder FOLDER'`` runs it in a folder with a lake, to which it adds what it makes.
"""

from __future__ import annotations

import tempfile
from contextlib import nullcontext
from pathlib import Path

import click

from scenarionet_pipelines.cli.progress import ProgressDisplay
from scenarionet_pipelines.notebooks import names
from scenarionet_pipelines.notebooks.execution import execute, make_example_lake
from scenarionet_pipelines.notebooks.rendering import render

PAGES = Path(__file__).parents[3] / "docs" / "notebooks"


@click.command()
@click.argument("chosen", nargs=-1)
@click.option("--folder", help="Folder with a lake of recordings, instead of generated scenarios.")
def main(chosen: tuple[str, ...], folder: str | None) -> None:
    """Render these notebooks, or all of them."""
    place = tempfile.TemporaryDirectory() if folder is None else nullcontext(folder)
    with place as found, ProgressDisplay("notebooks", "notebook") as progress:
        if folder is None:
            make_example_lake(Path(found))
        wanted = chosen or names()
        for number, name in enumerate(wanted):
            progress.update(number, len(wanted), 0)
            page = render(execute(name, Path(found)), name, PAGES, Path(found))
            click.echo(page)


if __name__ == "__main__":
    main()
