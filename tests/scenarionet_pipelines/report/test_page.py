"""A report's page: one self-contained file with escaped text, on the command line and in a browser."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from html.parser import HTMLParser

import pytest

from scenarionet_data import Lake
from scenarionet_pipelines.report.markup import Markup, joined, tag
from scenarionet_pipelines.report.page import render
from tests.fixtures.lakes import write_lake
from tests.fixtures.made import NAME, write_raw
from tests.fixtures.pages import HOSTILE, WIDTHS, check_layout, launched, visiting, without_numbers
from tests.fixtures.scenarios import make_scenario
from tests.scenarionet_pipelines.conftest import run

pytestmark = pytest.mark.integration

VOID = {"meta", "img", "br", "hr", "link"}


class Outline(HTMLParser):
    """The elements of a page; checks that each is closed in the right place."""

    def __init__(self, text):
        super().__init__()
        self.open, self.tags, self.attributes = [], [], []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, name, attributes):
        self.tags.append(name)
        self.attributes += attributes
        if name not in VOID:
            self.open.append(name)

    def handle_endtag(self, name):
        assert self.open.pop() == name


def test_text_is_escaped():
    assert tag("p", "<b>", Markup("<i></i>"), None, title='"x"') == '<p title="&quot;x&quot;">&lt;b&gt;<i></i></p>'
    assert joined("a & b", tag("br")) == "a &amp; b<br>"


def test_page_is_self_contained(contents):
    text = render(contents)
    outline = Outline(text)
    assert {"script", "link", "iframe", "form"}.isdisjoint(outline.tags)
    for name, value in outline.attributes:
        if name in ("src", "href"):
            assert value.startswith(("data:image/png;base64,", "#"))
    assert not re.search(r"url\(|@import|https?:", text)
    links = {value[1:] for name, value in outline.attributes if name == "href"}
    assert links == {"overview", "comparison", "distributions", "quality", "scenarios"}
    assert links <= {value for name, value in outline.attributes if name == "id"}


def test_hostile_names_are_escaped(contents):
    (section,) = contents.sections
    picture = replace(section.pictures["random"][0], scenario_id=HOSTILE, reason=HOSTILE)
    hostile = replace(section, statistics=replace(section.statistics, name=HOSTILE), pictures={"random": [picture]})
    text = render(replace(contents, name=HOSTILE, sections=(hostile, section)))
    Outline(text)
    assert "<img src=x" not in text
    assert "&lt;img src=x onerror=" in text


@pytest.mark.long
def test_report_command(lake, tmp_path):
    file = tmp_path / "report.html"
    result = run("report", lake.root, "busy", "-o", file, "--json")
    assert result.exit_code == 0, result.output
    said = json.loads(result.stdout)
    assert said == {"file": str(file), "bytes": file.stat().st_size, "databases": ["busy@1"],
                    "scenarios": len(lake.database("busy"))}  # fmt: skip
    again = run("report", lake.root, "-o", file)
    assert again.exit_code == 2
    assert "--replace" in again.stderr
    assert run("report", lake.root, "calm", "-o", file, "--replace", "--no-check").exit_code == 0
    assert "Quality" not in file.read_text()
    assert run("report", lake.root, "-o", tmp_path / "report.pdf").exit_code == 2
    assert run("report", lake.root, "nobody", "-o", tmp_path / "x.html").exit_code == 2
    assert sorted(path.name for path in tmp_path.iterdir()) == ["report.html"]


@pytest.fixture(scope="module")
def browser():
    with launched() as found:
        yield found


def write_odd(kind, lake, folder):
    """Write a report of one kind of lake; return its file."""
    file = folder / "report.html"
    if kind == "empty":
        assert run("convert", NAME, write_raw(folder / "raw", {"a": ["1 invalid"]}), folder / "lake").exit_code == 1
        words = [folder / "lake"]
    elif kind == "one":
        words = [write_lake(folder / "lake", [make_scenario(3, num_steps=1, has_map=False)]).root]
    elif kind == "NaN":
        made = write_lake(folder / "lake", [make_scenario(seed) for seed in range(5)])
        without_numbers(made.root)
        words = [made.root]
    elif kind == "empty database":
        Lake(lake.root).filter("num_objects > 1e6", name="nobody", allow_empty=True, replace=True)
        words = [lake.root, "nobody", "busy"]
    else:
        words = [lake.root, *(["busy", "calm"] if kind == "databases" else [])]
    result = run("report", *words, "-o", file)
    assert result.exit_code == 0, result.output
    return file


@pytest.mark.long
@pytest.mark.parametrize("kind", ["lake", "databases", "empty", "one", "NaN", "empty database"])
def test_page_in_a_browser(browser, lake, tmp_path, kind):
    """No script, no errors, no requests, no overflow, in light and dark mode."""
    file = write_odd(kind, lake, tmp_path)
    for width in WIDTHS:
        for scheme in ("light", "dark"):
            with visiting(browser, file.as_uri(), width, color_scheme=scheme, offline=True) as page:
                check_layout(page, "nav a", "summary")
                assert (
                    page.evaluate(
                        "performance.getEntriesByType('resource').filter(e => !e.name.startsWith('data:')).length"
                    )
                    == 0
                )
                assert page.evaluate("[...document.images].every((image) => image.naturalWidth > 0)")
                shown = page.inner_text("main")
                assert "nan" not in shown.lower().split()
                assert ("This lake has no scenarios yet" in shown) == (kind == "empty")
