"""The scenarios that are most like one, in the page."""

from __future__ import annotations

from urllib.parse import urlencode

import pytest

from scenarionet_data import Lake
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.lakes import write_lake
from tests.fixtures.pages import serving, visiting, wait_until

pytestmark = pytest.mark.integration


@pytest.fixture(scope="module")
def alike(tmp_path_factory):
    """Three drives: two behind a car, one without."""
    drives = [make_drive("a", others=(Other(25.0),)), make_drive("b", others=(Other(26.0),)), make_drive("c")]
    made = write_lake(tmp_path_factory.mktemp("alike") / "lake", drives)
    made.embed("v")
    return Lake(made.root)


def test_nearest_scenarios_are_listed_and_opened(browser, alike):
    first, second, third = (each for each in alike.sql("SELECT scenario_id FROM metadata ORDER BY 1")["scenario_id"])
    with (
        serving(alike) as address,
        visiting(browser, f"{address}/?{urlencode({'scenario': first, 'at': '0.5'})}") as page,
    ):
        page.get_by_text("More like this", exact=True).click()
        page.wait_for_selector("#player .like li:nth-child(2)")
        assert page.locator("#player .like a").all_inner_texts() == [second, third]
        page.get_by_role("link", name=second).click()
        wait_until(page, f"location.search === '?{urlencode({'scenario': second})}'")


def test_lake_without_an_embedding_says_how_to_write_one(browser, address, driven):
    scenario = driven.sql("SELECT scenario_id FROM metadata")["scenario_id"][0]
    with visiting(browser, f"{address}/?{urlencode({'scenario': scenario})}") as page:
        page.get_by_text("More like this", exact=True).click()
        wait_until(page, "document.querySelector('#player .like').innerText.includes('scenarionet db embed')")
