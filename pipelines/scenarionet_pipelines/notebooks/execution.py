"""Running notebooks: all cells in a kernel of their own, in a folder that holds a lake."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from scenarionet_data import convert
from scenarionet_data.converters.pg import ProceduralOptions
from scenarionet_data.errors import needing
from scenarionet_pipelines.notebooks import path

CELL_SECONDS = 300
"""After which a cell is taken to hang."""


def read(name: str) -> Any:
    """A notebook as nbformat's node.

    Raises:
        MissingDependency: nbformat is not installed.
    """
    with needing("notebooks need nbclient and more", "notebooks"):
        import nbformat
    return nbformat.read(path(name), as_version=4)  # type: ignore[no-untyped-call]


def execute(name: str, folder: Path) -> Any:
    """A notebook with its outputs.

    Args:
        name: Name of the notebook.
        folder: Working directory, with a lake called ``lake`` in it.

    Raises:
        CellExecutionError: A cell failed (nbclient's error, with the cell and its traceback).
    """
    notebook = read(name)
    from nbclient import NotebookClient

    client = NotebookClient(notebook, timeout=CELL_SECONDS, resources={"metadata": {"path": str(folder)}})
    return client.execute()


def strip(notebook: Any) -> Any:
    """The notebook without what running it left: outputs, counts, times."""
    for cell in notebook.cells:
        if cell.cell_type == "code":
            cell.outputs, cell.execution_count = [], None
        cell.metadata = {key: value for key, value in cell.metadata.items() if key == "tags"}
    return notebook


def make_example_lake(folder: Path, num_scenarios: int = 40) -> None:
    """A lake to look at, ``folder/lake``: generated roads with usual traffic, and half as many with a rush hour's."""
    lake, half = folder / "lake", num_scenarios // 2
    convert("pg", f"0:{num_scenarios}", lake, split="train")
    crowded = ProceduralOptions(density=3.0, num_blocks=3)
    convert("pg", f"1000:{1000 + half}", lake, split="val", version="rush_hour", options=crowded)
