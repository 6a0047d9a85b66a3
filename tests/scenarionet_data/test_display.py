"""What a notebook shows of a scenario, a lake and a database."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from html.parser import HTMLParser

import pytest

from scenarionet_data import Lake
from scenarionet_data.display import database_card, lake_card, scenario_card
from scenarionet_data.storage.files.local import LocalLakeFiles
from scenarionet_data.storage.snapshots import snapshot as snapshots
from scenarionet_data.storage.snapshots.snapshot import Snapshot
from tests.fixtures.drives import make_drive
from tests.fixtures.lakes import write_lake
from tests.fixtures.scenarios import make_scenario

HOSTILE = "\"><script>alert(1)</script><img src=x onerror='alert(2)'>/../../etc/passwd'; DROP TABLE metadata; --"


class Page(HTMLParser):
    """What is on a page: tags with their attributes, and the words."""

    def __init__(self, html):
        super().__init__()
        self.tags, self.words = [], []
        self.feed(html)

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))

    def handle_data(self, words):
        self.words.append(words)

    def pictures(self):
        return [attributes for tag, attributes in self.tags if tag == "img"]


def test_a_scenario_shows_a_picture_and_facts():
    page = Page(scenario_card(make_scenario(1)))
    assert len(page.pictures()) == 1
    assert {"made/v1/s000001", "31 timesteps, 3.0 s, now at 10", "CC0", "nowhere"} <= set(page.words)


@pytest.mark.parametrize(
    "scenario",
    [make_drive(num_steps=1), make_drive(has_map=False), make_scenario(2, num_objects=1, num_lights=0)],
    ids=["one timestep", "no map", "alone"],
)
def test_odd_scenarios_show_themselves(scenario):
    assert len(Page(scenario_card(scenario)).pictures()) == 1


def test_a_hostile_id_is_words():
    page = Page(scenario_card(replace(make_drive(), id=HOSTILE)))
    assert HOSTILE in page.words
    assert {tag for tag, _ in page.tags} <= {"div", "img", "table", "tr", "th", "td"}
    assert all(picture["src"].startswith("data:image/png;base64,") for picture in page.pictures())
    assert all("onerror" not in attributes for _, attributes in page.tags)


def test_a_lake_shows_what_it_holds(tmp_path):
    lake = write_lake(tmp_path / "lake", [make_scenario(number) for number in range(6)])
    lake.filter("num_objects > 0", name="some")
    page = Page(lake_card(lake))
    assert len(page.pictures()) == 4
    assert {"made", "train", "6", "some"} <= set(page.words)
    assert lake_card(lake) == lake_card(lake), "the same scenarios every time"


def test_a_database_shows_how_it_was_made(tmp_path):
    lake = write_lake(tmp_path / "lake", [make_scenario(number) for number in range(6)])
    made = lake.filter("num_objects > 3 AND 'a<b' <> scenario_id", name="some")
    for database in (made, lake.database("some")):
        page = Page(database_card(database))
        assert len(page.pictures()) == 4
        assert "some@1" in page.words
        assert any("num_objects > 3 AND 'a<b' <> scenario_id" in word for word in page.words)
    assert len(Page(database_card(lake.filter("scenario_id LIKE '%s000002'", name="one"))).pictures()) == 1


def test_an_empty_lake_says_what_to_do(tmp_path):
    files = LocalLakeFiles(tmp_path / "lake")
    snapshots.publish(files, Snapshot(1, snapshots.now(), "test", (), ()))
    page = Page(lake_card(Lake(tmp_path / "lake")))
    assert page.pictures() == []
    assert "scenarionet convert" in page.words


def test_facts_are_shown_where_pictures_cannot_be(tmp_path, monkeypatch):
    lake = write_lake(tmp_path / "lake", [make_scenario(1)])
    with monkeypatch.context() as without:
        without.setitem(sys.modules, "matplotlib.figure", None)
        for name in list(sys.modules):
            if name.startswith("scenarionet_data.plots."):
                without.delitem(sys.modules, name)
        without.delattr("scenarionet_data.plots.thumbnails", raising=False)
        page = Page(lake_card(lake))
    assert page.pictures() == []
    assert any("pip install 'scenarionet-lake[plots]'" in word for word in page.words)
    for path in (lake.root / "tracks").rglob("*.parquet"):
        path.unlink()
    page = Page(lake_card(lake))
    assert any(word.startswith("no pictures: ") for word in page.words)
    assert "made" in page.words


@pytest.mark.long
def test_a_notebook_shows_html(tmp_path):
    pytest.importorskip("IPython")
    root = write_lake(tmp_path / "lake", [make_scenario(1)]).root
    code = (
        "from IPython.core.interactiveshell import InteractiveShell\n"
        "shell = InteractiveShell.instance()\n"
        "from scenarionet_data import Lake, ScenarioLoader\n"
        f"lake = Lake({str(root)!r})\n"
        "for shown in (lake, lake.select(), lake.select()[0], ScenarioLoader(lake)):\n"
        "    html = shell.display_formatter.format(shown)[0]['text/html']\n"
        "    print('<table>' in html, len(repr(shown).splitlines()))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == ["True 1"] * 4
