"""Notebooks with their outputs as Markdown pages: words, code, tables as text, pictures beside the page."""

from __future__ import annotations

import base64
import hashlib
import re
from pathlib import Path
from typing import Any

_ESCAPES = re.compile(r"\x1b\[[0-9;]*m")


def render(notebook: Any, name: str, folder: Path, runs_in: Path) -> Path:
    """Write ``name.md`` and its pictures.

    Args:
        notebook: With its outputs.
        name: The page's.
        folder: Where it is written; what an earlier rendering left of this page is removed.
        runs_in: Folder that the notebook ran in; its path is nobody's business and left out.

    Returns:
        The page.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob(f"{name}-*.png"):
        old.unlink()
    parts = [f"<!-- made by `make notebooks` from pipelines/notebooks/{name}.ipynb -->"]
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            parts.append(cell.source)
            continue
        parts.append(f"```python\n{cell.source}\n```")
        printed = "".join(output.text for output in cell.outputs if output.get("name") == "stdout")
        parts += [_text(printed)] if printed.strip() else []
        shown = [part for output in cell.outputs for part in _shown(output, name, folder)]
        parts += dict.fromkeys(shown)  # ten videos are one note
    page = folder / f"{name}.md"
    text = "\n\n".join(parts) + "\n"
    page.write_text(text.replace(f"{runs_in}/", "").replace(str(runs_in), "."), "utf-8")
    return page


def _shown(output: Any, name: str, folder: Path) -> list[str]:
    """What a page shows of an output that is not printed: a picture, else its text."""
    data = output.get("data", {})
    if "image/png" in data:
        content = base64.b64decode(data["image/png"])
        picture = f"{name}-{hashlib.sha256(content).hexdigest()[:8]}.png"
        (folder / picture).write_bytes(content)
        return [f"![A figure of this notebook]({picture})"]
    if "application/vnd.plotly.v1+json" in data:
        return ["*(an interactive view, in the notebook)*"]
    if "<video" in data.get("text/html", ""):
        return ["*(a video, in the notebook)*"]
    return [_text(data["text/plain"])] if "text/plain" in data else []


def _text(words: str) -> str:
    return f"```text\n{_ESCAPES.sub('', words).rstrip()}\n```"
