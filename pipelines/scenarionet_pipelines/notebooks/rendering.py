"""Notebooks with their outputs as Markdown pages: text, code, tables as text, pictures in separate files."""

from __future__ import annotations

import base64
import hashlib
import re
from pathlib import Path
from typing import Any

from scenarionet_data.plots.files import as_webp

_ESCAPES = re.compile(r"\x1b\[[0-9;]*m")


def render(notebook: Any, name: str, folder: Path, runs_in: Path) -> Path:
    """Write ``name.md`` and its pictures.

    Args:
        notebook: With its outputs.
        name: The page's.
        folder: Output folder; files of an earlier rendering of this page are removed.
        runs_in: Folder that the notebook ran in; its path is removed from the outputs.

    Returns:
        The page.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob(f"{name}-*.*"):
        old.unlink()
    parts = [f"<!-- made by `make notebooks` from pipelines/notebooks/{name}.ipynb -->"]
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            parts.append(cell.source)
            continue
        parts.append(f"```python\n{cell.source}\n```")
        printed = "".join(output.text for output in cell.outputs if output.get("name") == "stdout")
        parts += [_text(printed)] if printed.strip() else []
        videos = [video for output in cell.outputs for video in _videos(output)]
        if videos:  # Markdown can show a moving picture
            parts.append(f"![A video of this notebook]({_write(as_webp(videos[0]), 'webp', name, folder)})")
        if len(videos) > 1:
            parts.append(f"*({len(videos) - 1} more, in the notebook)*")
        parts += [part for output in cell.outputs for part in _shown(output, name, folder)]
    page = folder / f"{name}.md"
    text = "\n\n".join(parts) + "\n"
    page.write_text(text.replace(f"{runs_in}/", "").replace(str(runs_in), "."), "utf-8")
    return page


def _shown(output: Any, name: str, folder: Path) -> list[str]:
    """What a page shows of an output that is not printed: a picture, else its text."""
    data = output.get("data", {})
    if "image/png" in data:
        picture = _write(base64.b64decode(data["image/png"]), "png", name, folder)
        return [f"![A figure of this notebook]({picture})"]
    return [_text(data["text/plain"])] if "text/plain" in data and not _videos(output) else []


def _videos(output: Any) -> list[bytes]:
    """The video that an output plays, if it does."""
    found = re.findall(r'<video[^>]*src="data:video/mp4;base64,([^"]*)"', output.get("data", {}).get("text/html", ""))
    return [base64.b64decode(text) for text in found]


def _write(content: bytes, kind: str, name: str, folder: Path) -> str:
    """Write a picture under a name derived from its content; return the name."""
    picture = f"{name}-{hashlib.sha256(content).hexdigest()[:8]}.{kind}"
    (folder / picture).write_bytes(content)
    return picture


def _text(words: str) -> str:
    return f"```text\n{_ESCAPES.sub('', words).rstrip()}\n```"
