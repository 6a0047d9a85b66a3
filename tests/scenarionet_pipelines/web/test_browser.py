"""The page in a real browser: scripts, layout, filter, sort, paging, saving, the player, and unusual input."""

from __future__ import annotations

import io
import re
from urllib.parse import urlencode

import numpy as np
import pytest
from matplotlib.image import imread

from scenarionet_data import Lake
from tests.fixtures.lakes import write_lake
from tests.fixtures.made import NAME, write_raw
from tests.fixtures.pages import WIDTHS, check_layout, serving, visiting, wait_until, without_numbers
from tests.fixtures.scenarios import make_scenario
from tests.fixtures.waiting import until
from tests.scenarionet_pipelines.conftest import run

pytestmark = pytest.mark.integration


def ids(page):
    page.wait_for_selector("tbody tr")
    wait_until(page, "!document.querySelector('#table').hasAttribute('aria-busy')")
    return page.locator("tbody th.id").all_inner_texts()


def apply(page, where):
    page.fill("#where", where)
    with page.expect_response(lambda response: "/api/rows" in response.url):
        page.keyboard.press("Enter")


def test_page_and_player_open(browser, served):
    """The only browser test of the default run: no script fails, a scenario is drawn and plays."""
    with visiting(browser, served) as page:
        assert len(ids(page)) == 50
        page.locator("tbody th.id a").nth(10).click()
        page.wait_for_selector("#player canvas")
        before = page.inner_text("#player .time")
        page.keyboard.press(" ")
        wait_until(page, "(before) => document.querySelector('#player .time').innerText !== before", before)


@pytest.mark.long
@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_layout(browser, served, lake, width, scheme):
    with visiting(browser, served, width, color_scheme=scheme) as page:
        assert len(ids(page)) == 50
        wait_until(page, "document.querySelector('tbody img').naturalWidth > 0")
        check_layout(page, "header button", "header input", "tbody th.id a", ".pages button", ".pages input")
        page.goto(f"{served}/?{urlencode({'scenario': make_scenario(20).id})}")
        page.wait_for_selector("#player canvas")
        check_layout(page, "#player button", "#player .row input", "#player .layers label", "#player summary")


@pytest.mark.long
def test_filter_sort_and_paging(browser, served, lake):
    with visiting(browser, served) as page:
        wanted = lake.sql("SELECT scenario_id FROM metadata ORDER BY scenario_id")["scenario_id"].to_list()
        assert ids(page) == wanted[:50]
        with page.expect_response(lambda response: "/api/rows" in response.url):
            page.get_by_role("button", name="Next").click()
        wait_until(page, "document.querySelectorAll('tbody tr').length === 9")
        assert ids(page) == wanted[50:]
        assert page.get_by_role("button", name="Next").is_disabled()
        apply(page, "num_objects > 5")
        count = lake.sql("SELECT count(*) AS n FROM metadata WHERE num_objects > 5")["n"].item()
        assert 50 < count < 59
        wait_until(page, f"document.querySelector('#count').innerText.includes('of {count}')")
        with page.expect_response(lambda response: "/api/rows" in response.url):
            page.get_by_role("button", name="ego_distance").click()
        page.wait_for_selector("th[aria-sort=descending]")
        order = (
            "SELECT scenario_id FROM metadata WHERE num_objects > 5 ORDER BY ego_distance DESC NULLS LAST, scenario_id"
        )
        wanted = lake.sql(order)["scenario_id"].to_list()
        assert ids(page) == wanted[:50]
        page.reload()
        assert ids(page) == wanted[:50], "the address says what is shown"
        page.go_back()
        page.wait_for_selector("th[aria-sort=ascending]")
        page.select_option("#database", "several")
        wait_until(page, "location.search.includes('database=several')")


@pytest.mark.long
def test_errors_are_marked_and_columns_suggested(browser, served):
    with visiting(browser, served) as page:
        ids(page)
        apply(page, "num_objects > 1 AND ego_dist > 3")
        page.wait_for_selector("#problem mark")
        assert page.inner_text("#problem mark") == "ego_dist"
        assert "ego_distance" in page.inner_text("#problem span")
        page.provoked.append("status of 400")  # the browser logs the refused request too
        page.fill("#where", "")
        page.locator("#where").press_sequentially("ego_dis")
        page.keyboard.press("ArrowDown")
        page.keyboard.press("Enter")
        assert page.input_value("#where") == "ego_distance"
        apply(page, "ego_distance > 3")
        page.wait_for_selector("#problem", state="hidden")


@pytest.mark.long
def test_player_controls(browser, served):
    scenario = make_scenario(20)
    with visiting(browser, f"{served}/?{urlencode({'scenario': scenario.id})}") as page:
        page.wait_for_selector("#player canvas")

        def step():
            return int(re.search(r"step (\d+)", page.inner_text("#player .time")).group(1))

        def picture():
            return page.evaluate(
                "() => new Promise((r) => requestAnimationFrame(() => requestAnimationFrame("
                "() => r(document.querySelector('canvas').toDataURL()))))"
            )

        assert step() == scenario.current_timestep
        page.keyboard.press("Home")
        page.keyboard.press("ArrowRight")
        assert step() == 1
        page.locator("#player input[type=range]").fill("7")
        assert step() == 7
        shown = picture()
        for change in (
            lambda: page.get_by_label("roads").uncheck(),
            lambda: page.get_by_label("roads").check(),
            lambda: page.keyboard.press("+"),
            lambda: page.get_by_role("button", name="Show the whole scenario").click(),
            lambda: page.keyboard.press("End"),
        ):
            change()
            until(lambda before=shown: picture() != before, "the picture changes")
            shown = picture()
        page.keyboard.press("Home")
        page.keyboard.press("f")
        box = page.locator("#player canvas").bounding_box()
        page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        page.wait_for_selector("#player .tip")
        assert page.inner_text("#player .tip strong") == "ego"
        assert "10.0 m/s" in page.inner_text("#player .tip")
        page.locator("#player .objects button", has_text="t1").first.click()
        assert page.locator("#player .chosen dd").first.inner_text() == "t1"
        page.select_option("#player select", "4")
        page.get_by_role("button", name="Play", exact=True).click()
        wait_until(page, "document.querySelector('.play').innerText === 'Play'")
        assert step() == scenario.num_timesteps - 1, "it plays to the end, and stops there"
        page.keyboard.press("Escape")
        page.wait_for_selector("tbody tr")


def test_next_and_previous_scenario_follow_the_table_over_its_pages(browser, served, lake):
    order = "SELECT scenario_id FROM metadata WHERE num_objects > 1 ORDER BY ego_distance DESC NULLS LAST, scenario_id"
    wanted = lake.sql(order)["scenario_id"].to_list()
    state = {"where": "num_objects > 1", "sort": "ego_distance", "order": "falling", "rows": 25, "scenario": wanted[24]}
    with visiting(browser, f"{served}/?{urlencode(state)}") as page:
        page.get_by_role("link", name="Next").click()
        wait_until(page, "(id) => document.querySelector('#player .id').innerText === id", wanted[25])
        page.wait_for_selector("#player [rel=prev]")
        assert "page=2" in page.url, "the table is at the page of the scenario"
        page.wait_for_selector("#player canvas")
        page.keyboard.press("v")
        page.keyboard.press("p")
        wait_until(page, "(id) => document.querySelector('#player .id').innerText === id", wanted[24])
        assert "look=3d" in page.url, "the view stays"
        page.goto(f"{served}/?{urlencode(state | {'scenario': wanted[0]})}")
        page.wait_for_selector("#player [rel=next]")
        assert page.locator("#player [rel=prev]").count() == 0


@pytest.mark.long
def test_address_holds_time_and_object(browser, served):
    with visiting(browser, f"{served}/?{urlencode({'scenario': make_scenario(20).id})}") as page:
        page.wait_for_selector("#player canvas")
        page.locator("#player .objects button").nth(2).click()
        chosen = page.inner_text("#player .objects button[aria-current]")
        for key in ("Home", "ArrowRight", "ArrowRight", "f"):
            page.locator("#content").press(key)
        shown, address = page.inner_text("#player .time"), page.url
        assert re.search(r"at=\d", address) and "object=" in address and "follow=1" in address
        page.reload()
        page.wait_for_selector("#player canvas")
        assert page.inner_text("#player .time") == shown
        assert page.inner_text("#player .objects button[aria-current]") == chosen
        assert page.locator("#player .view button[aria-pressed=true]").count() == 1
        page.locator("#content").press("Escape")
        page.wait_for_selector("tbody tr")
        assert "at=" not in page.url and "object=" not in page.url


@pytest.mark.long
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_canvas_follows_the_colour_scheme(browser, served, scheme):
    with visiting(browser, f"{served}/?{urlencode({'scenario': make_scenario(20).id})}", color_scheme=scheme) as page:
        page.wait_for_selector("#player canvas")
        wait_until(page, "document.querySelector('#player canvas').width > 300")
        picture = imread(io.BytesIO(page.locator("#player canvas").screenshot()))[..., :3]
        middle = np.median(picture.reshape(-1, 3).mean(axis=1))
        assert middle < 0.35 if scheme == "dark" else middle > 0.6


@pytest.mark.long
def test_dragging_and_scrolling_move_the_view(browser, served):
    with visiting(browser, f"{served}/?{urlencode({'scenario': make_scenario(20).id})}") as page:
        page.wait_for_selector("#player canvas")
        box = page.locator("#player canvas").bounding_box()
        x, y = box["x"] + 200, box["y"] + 150

        def ground():
            page.mouse.move(x, y)
            return page.evaluate("document.querySelector('canvas').toDataURL()")

        before = ground()
        page.mouse.down()
        page.mouse.move(x + 80, y + 40, steps=4)
        page.mouse.up()
        until(lambda: ground() != before, "the picture is dragged")
        dragged = ground()
        page.mouse.wheel(0, -400)
        until(lambda: ground() not in (before, dragged), "the picture is larger")


@pytest.mark.long
@pytest.mark.parametrize("width", WIDTHS)
def test_unusual_scenarios_are_drawn(browser, served, lake, width):
    """A hostile name, no map, a single timestep, only the ego: each opens, fits the page and shows its name."""
    (hostile,) = lake.sql("SELECT scenario_id FROM metadata WHERE city LIKE '<%'")["scenario_id"]
    for scenario_id in (hostile, *(make_scenario(seed).id for seed in (2, 3, 4))):
        with visiting(browser, f"{served}/?{urlencode({'scenario': scenario_id})}", width) as page:
            page.wait_for_selector("#player canvas")
            assert page.inner_text("#player h1") == scenario_id
            page.get_by_text("Scenario", exact=True).click()
            check_layout(page)
            assert page.title().startswith(scenario_id)
            assert page.locator("#player img, #player script").count() == 0


@pytest.mark.long
def test_ten_thousand_map_features_are_drawn(browser, tmp_path):
    """The map is redrawn when the view is zoomed or moved."""
    scenario = make_scenario(1, num_lanes=10_000)
    lake = write_lake(tmp_path / "lake", [scenario])
    with serving(lake) as address, visiting(browser, f"{address}/?{urlencode({'scenario': scenario.id})}") as page:
        page.wait_for_selector("#player canvas")
        for _ in range(5):
            page.keyboard.press("+")
        page.keyboard.press(" ")
        wait_until(page, "document.querySelector('.play').innerText === 'Play' && "
                         "document.querySelector('#player .time').innerText.includes('step 30 of 30')")  # fmt: skip


@pytest.mark.long
def test_hostile_name_is_escaped_in_the_table(browser, served):
    with visiting(
        browser, f"{served}/?{urlencode({'columns': 'city,source_scenario_id', 'where': 'starts_with(city, chr(60))'})}"
    ) as page:
        assert len(ids(page)) == 1
        assert "<img src=x onerror=" in page.inner_text("tbody")
        assert "ScenarioNet lake" in page.title()
        check_layout(page)


@pytest.mark.long
def test_missing_input_is_an_error(browser, served):
    with visiting(browser, f"{served}/?{urlencode({'scenario': 'made/v1/nobody'})}") as page:
        page.wait_for_selector("#player .problem")
        assert "made/v1/nobody" in page.inner_text("#player .problem")
        page.provoked.append("status of 404")
        page.get_by_role("link", name="All scenarios").first.click()
        apply(page, "num_objects > 1e6")
        page.wait_for_selector("#nothing")
        assert page.inner_text("#nothing") == "No scenario matches this filter."
        check_layout(page)


@pytest.mark.long
@pytest.mark.parametrize("width", WIDTHS)
def test_empty_lake(browser, tmp_path, width):
    raw = write_raw(tmp_path / "raw", {"a": ["1 invalid"]})
    assert run("convert", NAME, raw, tmp_path / "lake").exit_code == 1
    with serving(Lake(tmp_path / "lake")) as address, visiting(browser, address, width) as page:
        page.wait_for_selector("#nothing")
        assert "This lake has no scenarios yet" in page.inner_text("#nothing")
        check_layout(page)


@pytest.mark.long
def test_lake_of_one_scenario_and_non_finite_statistics(browser, tmp_path):
    lake = write_lake(tmp_path / "lake", [make_scenario(7)])
    without_numbers(lake.root)
    with serving(Lake(lake.root)) as address, visiting(browser, f"{address}/?sort=ego_distance&order=falling") as page:
        assert ids(page) == [make_scenario(7).id]
        assert "nan" in page.inner_text("tbody")
        check_layout(page)


@pytest.mark.long
def test_saving_the_filter(browser, tmp_path):
    lake = write_lake(tmp_path / "lake", [make_scenario(seed, num_objects=2 + seed) for seed in range(8)])
    with serving(lake, is_writable=True) as address, visiting(browser, address) as page:
        ids(page)
        apply(page, "num_objects > 4")
        page.get_by_role("button", name="Save as database").click()
        page.get_by_label("Name").fill("busy")
        page.get_by_role("button", name="Save", exact=True).click()
        page.wait_for_selector(".said.good")
        assert page.inner_text(".said") == f"busy@1: {len(lake.database('busy'))} scenarios saved"
        page.get_by_role("button", name="Close").click()
        page.select_option("#database", "busy")
        wait_until(page, "location.search.includes('database=busy')")
        page.get_by_role("button", name="Save as database").click()
        page.get_by_label("Name").fill("busy")
        page.get_by_role("button", name="Save", exact=True).click()
        page.wait_for_selector(".said.bad")
        assert "exists" in page.inner_text(".said")
        page.provoked.append("status of 409")


@pytest.mark.long
def test_read_only_page_cannot_save(browser, served):
    with visiting(browser, served) as page:
        ids(page)
        assert page.get_by_role("button", name="Save as database").count() == 0
        assert "read-only" in page.inner_text("header")
