"""What the documentation says is true: its tables are up to date, it names what there is."""

from __future__ import annotations

import re
import shlex
from dataclasses import asdict
from pathlib import Path

from scenarionet_data import converters
from scenarionet_data.quality import rules
from scenarionet_data.schema import dictionary, tables
from scenarionet_pipelines import notebooks
from scenarionet_pipelines.cli import cli
from scenarionet_pipelines.cluster import profile as profiles
from scenarionet_sim import sensors
from tests.fixtures.examples import ROOT, blocks

PAGES = (ROOT / "README.md", *(page for page in (ROOT / "docs").rglob("*.md") if page.parent.name != "notebooks"))


def test_data_dictionary_is_up_to_date():
    written = (ROOT / "docs" / "reference" / "data_dictionary.md").read_text("utf-8")
    assert written == dictionary.markdown(), "run `make docs`"


def test_the_page_of_clusters_is_true():
    """It names every profile, its own is one, and what it lets type can be parsed."""
    page = (ROOT / "docs" / "guides" / "cluster.md").read_text("utf-8")
    assert [name for name in profiles.names() if f"| `{name}` |" not in page] == []
    (profile,) = blocks("docs/guides/cluster.md", "toml")
    assert profiles.parse(profile, "mine.toml").workers == 2
    lines = [
        line
        for kind in ("bash", "sh")
        for block in blocks("docs/guides/cluster.md", kind)
        for line in block.splitlines()
    ]
    for line in lines:
        program, name, *words = shlex.split(line)
        if program == "scenarionet":
            cli.get_command(None, name).make_context(name, words)


def test_paper_page_names_tests_that_exist():
    """In a row of the table, ``::test_name`` alone is in the file named before it."""
    page, folder = (ROOT / "docs" / "explanation" / "paper.md").read_text("utf-8"), ROOT / "tests" / "scenarionet_sim"
    assert page.count("::test_") > 20
    for row in page.splitlines():
        where = ""
        for file, name in re.findall(r"`([\w/]+\.py)?(?:::(test_\w+))?`", row.rpartition(" | ")[2]):
            where = file or where
            assert not name or f"def {name}(" in (folder / where).read_text("utf-8"), f"{where}::{name}"
        for part in re.findall(r"`([a-z_]+/)`", row.rpartition(" | ")[2]):
            assert list((folder / part).glob("test_*.py")), part


def test_pages_show_pictures_that_are_there_and_small():
    """None is left over, and every notebook has its row."""
    shown = {
        (page.parent / name).resolve()
        for page in PAGES
        for name in re.findall(r"!\[[^\]]*\]\(([^)]+)\)", page.read_text("utf-8"))
    }
    assert [path for path in shown if not 0 < path.stat().st_size < 150_000] == []
    assert set((ROOT / "docs" / "pictures").iterdir()) <= shown
    text = "".join(page.read_text("utf-8") for page in PAGES)
    assert [name for name in notebooks.names() if f"notebooks/{name}.md)" not in text] == []


def test_links_lead_somewhere():
    """To a file of the repository, and to a heading in it."""
    lost = []
    for page in PAGES:
        for link in re.findall(r"\]\((?!\w+:)([^)\s]+)\)", page.read_text("utf-8")):
            name, _, heading = link.partition("#")
            target = page.parent / name if name else page
            if not target.exists() or (heading and heading not in anchors(target)):
                lost.append(f"{page.name}: {link}")
    assert lost == []


def anchors(page: Path) -> set[str]:
    """Names by which links reach a page's headings."""
    headings = re.findall(r"^#+ (.*)$", page.read_text("utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_sensors_page_lists_every_sensor():
    page = (ROOT / "docs" / "guides" / "sensors.md").read_text("utf-8")
    kinds = [name for name in sensors.__all__ if name not in ("Sensor", "Channel")]
    assert [name for name in kinds if f"| `{name}` |" not in page] == []


def test_evaluation_page_explains_every_metric():
    page = (ROOT / "docs" / "guides" / "evaluation.md").read_text("utf-8")
    table = tables.load("results")
    explained = {column.name for column in (*table.columns, *table.derived)} - {"run", "scenario_id", "track_id"}
    assert [name for name in sorted(explained) if f"`{name}`" not in page] == []


def test_the_page_of_checks_is_true():
    """It lists every rule as its file says and every dataset's budgets; its rule of one's own is one."""
    page = (ROOT / "docs" / "guides" / "checks.md").read_text("utf-8")
    for check in map(rules.load, rules.names()):
        assert f"| `{check.name}` | {check.kind} | {check.doc} |" in page
    for dataset in converters.names():
        numbers = " | ".join(f"{number:g}" for number in asdict(converters.budgets(dataset)).values())
        assert f"| `{dataset}` | {numbers} |" in page


def test_readme_names_make_targets_that_exist():
    targets = set(re.findall(r"^([a-z0-9-]+):", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE))
    named = set(re.findall(r"(?:^|`)make ([a-z0-9-]+)", (ROOT / "README.md").read_text("utf-8"), re.MULTILINE))
    assert {"demo", "test"} <= named <= targets
