"""axe-core finds no serious violation on any page of the browser, in light and dark mode, wide and narrow."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from urllib.parse import urlencode

import pytest

from tests.fixtures.pages import WIDTHS, visiting, wait_until

pytestmark = pytest.mark.integration

_RUN = """async () => {
  const { violations } = await axe.run(document, { resultTypes: ["violations"] });
  const serious = violations.filter(({ impact }) => impact === "serious" || impact === "critical");
  const where = ({ html, any }) => `${html.slice(0, 160)} ${any[0]?.message ?? ""}`;
  return serious.map(({ id, nodes }) => [id, ...nodes.slice(0, 3).map(where)]);
}"""


@pytest.fixture(scope="module")
def axe():
    """Source of axe-core."""
    found = find_spec("axe_playwright_python")
    if found is None or found.origin is None:
        pytest.skip("no axe-core here: pip install axe-playwright-python")
    return Path(found.origin).with_name("axe.min.js").read_text("utf-8")


PAGES = {
    "table": ({}, "tbody tr"),
    "charts": ({"charts": "ego_distance,num_objects", "ranges": "ego_distance:1:200"}, ".chart .bars"),
    "gallery": ({"view": "gallery"}, ".gallery tbody tr"),
    "player": ({"runs": "straight,idm", "scenario": True}, "#player .event.crash"),
    "space": ({"runs": "straight", "look": "3d", "scenario": True}, "#player .runs input:checked"),
    "camera": ({"camera": "chase", "scenario": True}, "#player .seen canvas[aria-label]"),
    "clip": ({"scenario": True, "clip": True}, "#player .runs input"),
}


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("name", PAGES)
def test_nothing_serious(browser, address, driven, axe, name, scheme, width):
    state, selector = PAGES[name]
    if "scenario" in state:
        crashed = "SELECT scenario_id FROM results WHERE run = 'straight' AND cost > 0 LIMIT 1"
        state = state | {"scenario": driven.sql(crashed)["scenario_id"].item()}
    with visiting(browser, f"{address}/?{urlencode(state)}", width, color_scheme=scheme) as page:
        page.wait_for_selector(selector)
        if "clip" in state:
            page.get_by_role("button", name="Clip…").click()
        page.evaluate(axe)
        assert page.evaluate(_RUN) == []
        wait_until(page, "document.documentElement.scrollWidth <= innerWidth")
