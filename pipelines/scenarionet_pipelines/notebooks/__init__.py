"""Notebooks to start from: a lake seen from several sides. Each runs in the folder that holds the lake."""

from __future__ import annotations

from pathlib import Path

FOLDER = Path(__file__).parent


def names() -> list[str]:
    """Names of all notebooks, sorted."""
    return sorted(path.stem for path in FOLDER.glob("*.ipynb"))


def path(name: str) -> Path:
    """A notebook's file."""
    return FOLDER / f"{name}.ipynb"
