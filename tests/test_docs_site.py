"""The documentation site builds strictly, opens without a network, and its reference lists the public names."""

from __future__ import annotations

import importlib
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest

from tests.fixtures.examples import ROOT

LOADING = {"script": "src", "img": "src", "link": "href", "iframe": "src", "source": "src", "video": "src"}
"""Attributes whose resources a browser loads without a click."""


@pytest.mark.parametrize("package", ["scenarionet_data", "scenarionet_sim"])
def test_reference_documents_exactly_the_public_names(package):
    page = (ROOT / "docs" / "reference" / f"{package}.md").read_text("utf-8")
    documented = re.findall(rf"^::: {package}\.(\w+)$", page, re.MULTILINE)
    assert sorted(documented) == sorted(set(importlib.import_module(package).__all__) - {"__version__"})


class _Resources(HTMLParser):
    """Collects what a page loads."""

    def __init__(self) -> None:
        super().__init__()
        self.urls: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = dict(attrs)
        if tag != "link" or "canonical" not in (values.get("rel") or ""):
            self.urls.append(values.get(LOADING.get(tag, ""), "") or "")


@pytest.mark.long
def test_site_builds_strictly_and_is_self_contained(tmp_path):
    pytest.importorskip("mkdocs", reason="the extra `docs` is not installed")
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(tmp_path)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    pages = sorted(tmp_path.rglob("*.html"))
    assert len(pages) > 40
    assert [(page.name, url) for page in pages for url in _loaded(page) if re.match(r"(https?:)?//", url)] == []
    found = (tmp_path / "search" / "search_index.js").read_text("utf-8")
    assert all(word in found for word in ("ScenarioLoader", "scenarionet convert", "time_to_collision", "ego_distance"))


def _loaded(page: Path) -> list[str]:
    resources = _Resources()
    resources.feed(page.read_text("utf-8"))
    return resources.urls
