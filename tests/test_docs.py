"""The documentation is accurate: tables are complete and up to date, links and names exist."""

from __future__ import annotations

import importlib
import re
import shlex
from dataclasses import asdict
from pathlib import Path

from gymnasium import registry

import scenarionet_sim
from scenarionet_data import converters
from scenarionet_data.interchange import WRITERS
from scenarionet_data.quality import rules
from scenarionet_data.schema import dictionary, tables
from scenarionet_pipelines import notebooks
from scenarionet_pipelines.cli.deprecated import MOVED
from scenarionet_pipelines.cli.group import find_verb
from scenarionet_pipelines.cluster import profile as profiles
from scenarionet_pipelines.verb_tree import GROUPS, full_name
from tests.fixtures.examples import ROOT, blocks

PAGES = (*ROOT.glob("*.md"), *(page for page in (ROOT / "docs").rglob("*.md") if page.parent.name != "notebooks"))


def test_data_dictionary_is_up_to_date():
    written = (ROOT / "docs" / "reference" / "data_dictionary.md").read_text("utf-8")
    assert written == dictionary.markdown(), "run `make docs`"


def test_cluster_page_is_accurate():
    """It names every profile, its example is a valid profile, and its commands parse."""
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
            name = full_name(words.pop(0)) if name in GROUPS else name
            find_verb(name).make_context(name, words)


def test_exchange_page_has_a_row_for_every_format():
    page = (ROOT / "docs" / "guides" / "exchange.md").read_text("utf-8")
    assert {*re.findall(r"^\| `(\w+)` \|", page, re.M)} == {
        "scenarionet", *WRITERS,
    }  # fmt: skip


def test_pages_and_messages_name_verbs_as_they_are_typed():
    """No old spelling: verbs that moved are named with their group."""
    sources = [path for folder in ("scenarionet_data", "scenarionet_sim", "pipelines", "schemas", "sql")
               for path in (ROOT / folder).rglob("*") if path.suffix in (".py", ".toml", ".sql", ".ipynb")]  # fmt: skip
    old = re.compile(rf"`scenarionet\s+({'|'.join(MOVED)})\b(?!-)")
    found = [(path.name, name) for path in (*PAGES, *sources) for name in old.findall(path.read_text("utf-8"))]
    assert [each for each in found if each[0] not in ("deprecated.py", "CHANGELOG.md")] == []


def test_paper_page_names_tests_that_exist():
    """In a row of the table, ``::test_name`` without a file refers to the file named before it."""
    page, folder = (ROOT / "docs" / "explanation" / "paper.md").read_text("utf-8"), ROOT / "tests" / "scenarionet_sim"
    assert page.count("::test_") > 20
    for row in page.splitlines():
        where = ""
        for file, name in re.findall(r"`([\w/]+\.py)?(?:::(test_\w+))?`", row.rpartition(" | ")[2]):
            where = file or where
            assert not name or f"def {name}(" in (folder / where).read_text("utf-8"), f"{where}::{name}"
        for part in re.findall(r"`([a-z_]+/)`", row.rpartition(" | ")[2]):
            assert list((folder / part).glob("test_*.py")), part


def test_pictures_exist_and_are_small():
    """No picture is unused, and every notebook is linked."""
    shown = {
        (page.parent / name).resolve()
        for page in PAGES
        for name in re.findall(r"!\[[^\]]*\]\(([^)]+)\)", page.read_text("utf-8"))
    }
    films = set((ROOT / "docs" / "films").iterdir())
    assert [path for path in shown - films if not 0 < path.stat().st_size < 150_000] == []
    assert [path for path in films if not 0 < path.stat().st_size < 1_500_000] == []
    assert films | set((ROOT / "docs" / "pictures").iterdir()) <= shown
    text = "".join(page.read_text("utf-8") for page in PAGES)
    assert [name for name in notebooks.names() if f"notebooks/{name}.md)" not in text] == []


def test_links_resolve():
    """Each link names a file of the repository and a heading in it."""
    lost = []
    for page in PAGES:
        for link in re.findall(r"\]\((?!\w+:)([^)\s]+)\)", page.read_text("utf-8")):
            name, _, heading = link.partition("#")
            target = page.parent / name if name else page
            if not target.exists() or (heading and heading not in anchors(target)):
                lost.append(f"{page.name}: {link}")
    assert lost == []


def anchors(page: Path) -> set[str]:
    """Anchors of a page's headings."""
    headings = re.findall(r"^#+ (.*)$", page.read_text("utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_architecture_page_names_files_that_exist():
    page = (ROOT / "docs" / "explanation" / "architecture.md").read_text("utf-8")
    named = set(re.findall(r"`([\w/]+\.(?:py|sql))`", page))
    folders = [ROOT, *(ROOT / name for name in ("scenarionet_data", "scenarionet_sim"))]
    folders += [ROOT / "pipelines" / "scenarionet_pipelines", ROOT / "pipelines"]
    assert len(named) > 50
    assert [name for name in sorted(named) if not any((folder / name).exists() for folder in folders)] == []


def test_each_flow_has_ten_steps():
    page = (ROOT / "docs" / "explanation" / "architecture.md").read_text("utf-8")
    flows = page.partition("\n## Flows\n")[2].partition("\n## ")[0].split("\n### ")[1:]
    assert len(flows) == 5
    for flow in flows:
        assert re.findall(r"^(\d+)\.", flow, re.MULTILINE) == [str(number) for number in range(1, 11)]


def test_examples_import_public_names_by_one_line_per_package():
    """``from scenarionet_data import ...``; modules that are public by themselves are listed here."""
    public = {
        "scenarionet_data.testing",
        "scenarionet_data.forecasts",
        "scenarionet_data.logical",
        "scenarionet_data.operations.moments",
        "scenarionet_data.operations.rates",
        "scenarionet_data.variations",
        "scenarionet_pipelines.cluster",
        "scenarionet_sim.backends.differentiable",
        "scenarionet_sim.borders.picture",
        "scenarionet_sim.learning.config",
        "scenarionet_sim.learning.training",
        "scenarionet_sim.metrics.navsim",
    }
    wrong = []
    for page in (ROOT / "README.md", *(ROOT / "docs").rglob("*.md")):
        for block in blocks(page.relative_to(ROOT).as_posix(), "python"):
            modules = re.findall(r"^(?:from|import) ((?:scenarionet)_\w+[\w.]*)", block, re.MULTILINE)
            wrong += [(page.name, name) for name in modules if "." in name and name not in public]
            wrong += [(page.name, name) for name in set(modules) if modules.count(name) > 1]
    assert wrong == []


def test_names_of_modules_and_environments_exist():
    """Every dotted name of our packages in the pages can be imported; every id of an environment is registered."""
    lost = []
    for page in PAGES:
        if page.name == "CHANGELOG.md":  # names of its time
            continue
        text = page.read_text("utf-8")
        for name in set(re.findall(r"(?:`|::: )(scenarionet_(?:data|sim|pipelines)(?:\.\w+)*\w)", text)):
            if not name.endswith((".py", ".md")) and not exists(name):
                lost.append((page.name, name))
        lost += [(page.name, name) for name in re.findall(r"ScenarioNet[\w-]*-v\d", text) if name not in registry]
    assert lost == []


def exists(dotted: str) -> bool:
    """Whether a dotted name is a module or an attribute of one; those that need an optional package count."""
    module, *names = dotted.split(".")
    found: object = importlib.import_module(module)
    for name in names:
        module = f"{module}.{name}"
        if hasattr(found, name):
            found = getattr(found, name)
            continue
        try:
            found = importlib.import_module(module)
        except ModuleNotFoundError as error:
            return not (error.name or "").startswith("scenarionet")
    return True


def test_sensors_page_lists_every_sensor():
    page = (ROOT / "docs" / "guides" / "sensors.md").read_text("utf-8")
    public = {name: getattr(scenarionet_sim, name) for name in scenarionet_sim.__all__}
    sensor = scenarionet_sim.Sensor
    kinds = [name for name, kind in public.items() if isinstance(kind, type) and issubclass(kind, sensor)]
    kinds.remove("Sensor")
    assert [name for name in kinds if f"| `{name}` |" not in page] == []


def test_evaluation_page_explains_every_metric():
    page = (ROOT / "docs" / "guides" / "evaluation.md").read_text("utf-8")
    table = tables.load("results")
    explained = {column.name for column in (*table.columns, *table.derived)} - {"run", "scenario_id", "track_id"}
    assert [name for name in sorted(explained) if f"`{name}`" not in page] == []


def test_checks_page_is_accurate():
    """It lists every rule with its file's description, and the budgets of every dataset."""
    page = (ROOT / "docs" / "guides" / "checks.md").read_text("utf-8")
    for check in map(rules.load, rules.names()):
        assert f"| `{check.name}` | {check.kind} | {check.doc} |" in page
    for dataset in converters.names():
        numbers = " | ".join(f"{number:g}" for number in asdict(converters.budgets(dataset)).values())
        assert f"| `{dataset}` | {numbers} |" in page


def test_readme_names_existing_make_targets():
    targets = set(re.findall(r"^([a-z0-9-]+):", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE))
    named = set(re.findall(r"(?:^|`)make ([a-z0-9-]+)", (ROOT / "README.md").read_text("utf-8"), re.MULTILINE))
    assert {"demo", "test"} <= named <= targets
