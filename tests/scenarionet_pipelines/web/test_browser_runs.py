"""Runs beside the recording, curves, events, clips and the view in space, in a real browser."""

from __future__ import annotations

import io
import shutil
from pathlib import Path
from urllib.parse import urlencode

import numpy as np
import pytest
from PIL import Image

from scenarionet_data import Lake
from scenarionet_data.operations.moments import relation
from scenarionet_sim import evaluate
from scenarionet_sim.evaluation.evaluation import plan_evaluation
from scenarionet_sim.evaluation.references import run_references
from tests.fixtures.drives import make_drive
from tests.fixtures.lakes import write_lake
from tests.fixtures.pages import serving, visiting, wait_until
from tests.fixtures.waiting import until

pytestmark = pytest.mark.integration


@pytest.fixture(scope="module")
def parked(driven):
    """The scenario in which a run hits a parked car."""
    (found,) = driven.sql("SELECT scenario_id FROM results WHERE run = 'straight' AND cost > 0")["scenario_id"].head(1)
    return found


def opened(browser, address, **state):
    return visiting(browser, f"{address}/?{urlencode(state)}")


def picture(page):
    page.evaluate("() => new Promise((r) => requestAnimationFrame(() => requestAnimationFrame(r)))")
    shown = Image.open(io.BytesIO(page.locator("#player canvas").screenshot()))
    return np.asarray(shown.convert("RGB")).astype(int)


def has_color(pixels, color, tolerance=40):
    wanted = [int(color[k : k + 2], 16) for k in (1, 3, 5)]
    return int((np.abs(pixels - wanted).max(axis=-1) < tolerance).sum()) > 20


def run_colors(page):
    return page.evaluate("fetch('/api/about').then((found) => found.json()).then(({ picture }) => picture.runs)")


def test_run_is_drawn_beside_the_recording(browser, address, parked):
    with opened(browser, address, scenario=parked, at="1.5") as page:
        page.wait_for_selector("#player .runs input")
        first, second, _ = run_colors(page)
        assert not has_color(picture(page), first)
        page.get_by_label("straight", exact=True).check()
        wait_until(page, "location.search.includes('runs=straight')")
        wait_until(page, "document.querySelector('#player .legend').innerText.includes('straight')")
        assert has_color(picture(page), first)
        page.get_by_label("idm", exact=True).check()
        wait_until(page, "decodeURIComponent(location.search).includes('runs=straight,idm')")
        assert has_color(picture(page), second)
        assert page.locator("#player .curve").count() == 6, "speed and acceleration of the recording and two runs"
        page.get_by_label("straight", exact=True).uncheck()
        wait_until(page, "location.search.includes('runs=idm')")
        assert not has_color(picture(page), first)


def test_address_holds_runs_and_view(browser, address, parked):
    with opened(browser, address, scenario=parked, at="1.50", runs="idm,straight", look="3d", follow="1") as page:
        page.wait_for_selector("#player .runs input:checked")
        wait_until(page, "document.querySelectorAll('#player .runs input:checked').length === 2")
        page.locator("#content").press("ArrowRight")
        wait_until(page, "location.search.includes('at=1.6')")
        found = page.evaluate("Object.fromEntries(new URLSearchParams(location.search))")
        assert (found["runs"], found["look"], found["follow"]) == ("idm,straight", "3d", "1")


def test_events_of_a_run_are_on_the_time_line(browser, address, parked, driven):
    (result,) = driven.sql(
        "SELECT * FROM results WHERE run = 'straight' AND scenario_id = $id", {"id": parked}
    ).to_dicts()
    with opened(browser, address, scenario=parked, runs="straight") as page:
        page.wait_for_selector("#player .event.crash")
        page.locator("#player .event.crash").first.click()
        shown = float(page.inner_text("#player .time").split(" /")[0])
        assert shown == pytest.approx(result["first_collision"], abs=0.15)
        page.wait_for_selector(f"#player .event.{result['status']}")


def test_curves_follow_the_selected_object_and_seek(browser, address, parked):
    with opened(browser, address, scenario=parked) as page:
        page.wait_for_selector("#player .curve", state="attached")  # a straight one has no height
        assert page.inner_text("#player .timeline h2") == "Over time: the ego"
        assert page.locator("#player .now").first.inner_text() == "10.0", "the ego drives at 10 m/s"
        page.locator("#player .objects button", has_text="t1").first.click()
        assert page.inner_text("#player .timeline h2") == "Over time: vehicle 1"
        assert page.locator("#player .now").first.inner_text() == "0.0", "t1 is parked"
        box = page.locator("#player .curves svg").first.bounding_box()
        page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        wait_until(page, "document.querySelector('#player .time').innerText.startsWith('2.0 / 4.0 s')")


def test_axes_end_at_round_numbers(browser, address, driven):
    (scenario,) = driven.sql("SELECT scenario_id FROM metadata WHERE dataset = 'pg' ORDER BY scenario_id LIMIT 1")[
        "scenario_id"
    ]
    with opened(browser, address, scenario=scenario) as page:
        page.wait_for_selector("#player .curve", state="attached")
        shown = page.locator("#player .curves small").all_inner_texts()
        recording = driven.loader([scenario])[0]
        speeds = np.hypot(*recording.tracks.velocity[recording.ego_index].T)
        assert float(shown[0]) >= speeds.max() > float(shown[0]) - 5, "just above all values"
        assert all(float(text) % 1 == 0 for text in shown), shown


def test_events_are_told_in_words(browser, address, parked):
    with opened(browser, address, scenario=parked, runs="straight") as page:
        page.wait_for_selector("#player .event.crash")
        assert page.inner_text("#player .event.crash") == "hits vehicle 1"
        assert page.locator("#player .objects button").all_inner_texts() == [
            "ego\nt0",
            "vehicle 1\nt1",
            "vehicle 2\nt2",
        ]


def test_references_are_folded_away(browser, tmp_path):
    lake = write_lake(tmp_path / "lake", [make_drive("free")])
    evaluate(lake, policy="constant", backend="kinematic", name="mine")
    run_references(plan_evaluation(lake, None, "constant"))
    with serving(lake) as address, opened(browser, address, scenario=make_drive("free").id) as page:
        page.wait_for_selector("#player .runs input")
        assert page.locator("#player .runs input:visible").count() == 1
        page.locator("#player .runs summary").click()
        folded = page.locator("#player .runs details")
        assert folded.locator("label").all_inner_texts() == ["constant velocity", "random actions", "recording"]
        assert folded.locator("input").first.is_disabled(), "their motion is not stored"


def test_runs_of_an_earlier_rule_are_not_listed_beside_others_without_a_word(browser, tmp_path):
    golden = Path(__file__).parents[2] / "golden" / "lakes" / "format-3" / "generated" / "lake"
    lake = Lake(shutil.copytree(golden, tmp_path / "lake"))
    (scenario_id,) = lake.sql("SELECT scenario_id FROM results WHERE run = 'driven'")["scenario_id"].head(1)
    with serving(lake) as address:
        for has_new in (False, True):
            if has_new:
                evaluate(lake, policy="idm", name="now")
            with opened(browser, address, scenario=scenario_id) as page:
                page.wait_for_selector("#player .runs input")
                said = page.locator("#player .runs p").all_inner_texts()
                assert any(each.startswith("Not all are scored by the same rule") for each in said) == has_new


def test_camera_shows_the_selected_object(browser, address, parked):
    """The picture in the picture is that of the server, changes with time and object, and says why there is none."""
    with opened(browser, address, scenario=parked, at="1.0") as page:
        page.wait_for_selector("#player canvas")
        page.keyboard.press("c")

        def seen():
            page.wait_for_selector("#player .seen canvas[aria-label]:not(.stale)")
            return page.evaluate("document.querySelector('#player .seen canvas').toDataURL()")

        first = seen()
        assert "camera=chase" in page.url
        page.keyboard.press("ArrowRight")
        until(lambda: seen() != first, "the picture follows the time")
        second = seen()
        page.locator("#player .objects button", has_text="t1").first.click()
        until(lambda: seen() != second, "the picture follows the selection")
        assert page.inner_text("#player .seen figcaption span") == "vehicle 1"
        page.get_by_label("Camera", exact=True).select_option("camera")
        wait_until(page, "document.querySelector('#player .seen canvas').ariaLabel.startsWith('Its own camera')")
        page.get_by_role("button", name="Larger").click()
        wait_until(page, "document.querySelector('#player .seen canvas').width === 960")
        page.get_by_label("straight", exact=True).check()
        wait_until(page, "document.querySelector('#player .seen figcaption span').innerText === 'vehicle 1, straight'")
        page.get_by_role("button", name="Close the camera").click()
        assert page.locator("#player .seen:visible").count() == 0
        wait_until(page, "!location.search.includes('camera=')")


def test_clip_is_drawn_and_offered(browser, address, parked):
    with opened(browser, address, scenario=parked, runs="straight") as page:
        page.wait_for_selector("#player .runs input:checked")
        page.get_by_role("button", name="Clip…").click()
        page.get_by_label("Format").select_option("gif")
        page.get_by_role("button", name="Draw").click()
        page.wait_for_selector("#clip a[download]")
        with page.expect_download() as download:
            page.click("#clip a[download]")
        assert download.value.suggested_filename.endswith(".gif")
        with Image.open(download.value.path()) as clip:
            assert clip.n_frames > 20


def test_view_in_space_shows_roads_objects_and_runs(browser, address, parked):
    with opened(browser, address, scenario=parked, at="1.5", runs="straight", look="3d", follow="1") as page:
        page.wait_for_selector("#player .runs input:checked")
        wait_until(page, "document.querySelector('#player .legend').innerText.includes('straight')")
        pixels = picture(page)
        (run, *_), ego = run_colors(page), "#d55e00"
        for color in ("#b9bfc7", ego, run):
            assert has_color(pixels, color, 60), color
        box = page.locator("#player canvas").bounding_box()
        page.mouse.move(box["x"] + 300, box["y"] + 200)
        page.mouse.down()
        page.mouse.move(box["x"] + 420, box["y"] + 240, steps=4)
        page.mouse.up()
        assert np.abs(picture(page) - pixels).mean() > 2, "the view turns"
        page.keyboard.press("v")
        wait_until(page, "!location.search.includes('look=')")
        assert has_color(picture(page), ego)


def test_object_in_space_is_picked_at_its_place(browser, address, parked):
    """The view stays where it followed t1 when another object is selected, so t1 is in the middle."""
    with opened(browser, address, scenario=parked, look="3d", object="t1", follow="1") as page:
        page.wait_for_selector("#player .runs input")
        picture(page)
        page.get_by_role("button", name="Follow").click()
        page.locator("#player .objects button", has_text="t0").first.click()
        assert page.inner_text("#player .chosen strong") == "ego"
        box = page.locator("#player canvas").bounding_box()
        page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        assert page.inner_text("#player .chosen strong") == "vehicle 1"


def test_charts_filter_the_table(browser, address, driven):
    with opened(browser, address) as page:
        page.wait_for_selector("tbody tr")
        page.get_by_label("Add a histogram").select_option("ego_distance")
        page.wait_for_selector(".chart .bars")
        everything = page.locator("tbody tr").count()
        box = page.locator(".chart .bars").bounding_box()
        page.mouse.move(box["x"] + 1, box["y"] + 20)
        page.mouse.down()
        page.mouse.move(box["x"] + box["width"] / 2, box["y"] + 20, steps=3)
        page.mouse.up()
        wait_until(page, "(count) => document.querySelectorAll('tbody tr').length < count", everything)
        page.wait_for_selector(".chart .bar-of.out", state="attached")  # an empty bin has no height
        limit = float(page.get_by_label("ego_distance, to").input_value())
        wanted = driven.sql("SELECT count(*) AS n FROM metadata WHERE ego_distance <= $most", {"most": limit})
        assert page.locator("tbody tr").count() == wanted["n"].item()
        page.reload()
        wait_until(page, "(count) => document.querySelectorAll('tbody tr').length === count", wanted["n"].item())
        page.wait_for_selector(".chart .bar-of.out", state="attached")  # an empty bin has no height
        page.get_by_role("button", name="All", exact=True).click()
        wait_until(page, "(count) => document.querySelectorAll('tbody tr').length === count", everything)


def test_gallery_shows_larger_pictures(browser, address):
    with opened(browser, address) as page:
        page.wait_for_selector("tbody img")
        width = "document.querySelector('tbody img').getBoundingClientRect().width"
        before = page.evaluate(width)
        page.get_by_role("button", name="Gallery").click()
        wait_until(page, "location.search.includes('view=gallery')")
        wait_until(page, f"(before) => {width} > 2.5 * before", before)


@pytest.fixture(scope="module")
def mined(driven, tmp_path_factory):
    lake = Lake(shutil.copytree(driven.root, tmp_path_factory.mktemp("mined") / "lake"))
    lake.keep_moments("close", {"near": relation("near_objects", {"distance_thresh": 8.0}).lasting()})
    with serving(lake) as found:
        yield lake, found


def test_a_run_is_a_table_with_the_failures_first(browser, mined):
    lake, found = mined
    with opened(browser, found) as page:
        page.wait_for_selector("#table tbody tr")
        assert page.locator("#table thead").inner_text().count("nuplan_score") == 0
        page.get_by_label("Run").select_option("straight")
        wait_until(page, "document.querySelector('#table thead').innerText.includes('nuplan_score')")
        wait_until(page, "document.querySelector('#table td[data-label=success]')?.innerText === 'no'")
        shown = [each.inner_text() for each in page.locator("#table td[data-label=success]").all()]
        assert shown == sorted(shown) and "no" in shown
        first = page.locator("#table th.id a").first
        name = first.inner_text()
        first.click()
        page.wait_for_selector("#player .runs input:checked")
        assert "straight" in page.locator("#player .legend").inner_text()
        page.go_back()
        page.wait_for_selector("#table tbody tr")
        page.get_by_label("Run").select_option("")
        wait_until(page, "!document.querySelector('#table thead').innerText.includes('nuplan_score')")
        assert name in lake.sql("SELECT scenario_id FROM results WHERE run = 'straight' AND NOT success")["scenario_id"]


def test_moments_are_filtered_and_told_by_name_and_role(browser, mined):
    lake, found = mined
    having = lake.sql("SELECT DISTINCT scenario_id FROM moments")["scenario_id"].to_list()
    assert 0 < len(having) < len(lake)
    with opened(browser, found) as page:
        page.wait_for_selector("#table tbody tr")
        page.get_by_label("Moments").select_option("close/near")
        wait_until(page, f"document.querySelectorAll('#table tbody tr').length === {len(having)}")
        assert sorted(each.inner_text() for each in page.locator("#table th.id a").all()) == sorted(having)
        page.locator("#table th.id a").first.click()
        row = page.get_by_role("group", name="Events of moments close")
        mark = row.get_by_role("button").filter(has_text="actor vehicle").first
        assert "near · actor " in mark.inner_text() and " · other " in mark.inner_text()
        mark.click()
        wait_until(page, "location.search.includes('object=')")
