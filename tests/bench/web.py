"""The report of 1,000 scenarios; in a real browser: first paint, filters over a million rows, frames per second."""

from __future__ import annotations

import json
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from statistics import median
from typing import Any
from urllib.parse import urlencode

from scenarionet_data import Lake
from scenarionet_pipelines.web import rows
from tests.bench.measure import Figure, in_fresh_process
from tests.bench.mining import recorded_lake
from tests.bench.scale import write_metadata_lake
from tests.fixtures.lakes import write_lake
from tests.fixtures.pages import launched, serving
from tests.fixtures.scenarios import make_scenario

_REPORT = """
import json, resource, sys, time
started = time.perf_counter()
from scenarionet_pipelines.report import gather, write
from scenarionet_pipelines.web import rows
from scenarionet_data import Lake
write(gather(Lake(sys.argv[1])), sys.argv[2])
used = resource.getrusage(resource.RUSAGE_SELF)
print(json.dumps({"wall": time.perf_counter() - started, "cpu": used.ru_utime + used.ru_stime}))
"""

_FRAMES = """(seconds) => new Promise((done) => {
  const times = [];
  const frame = (now) => {
    times.push(now);
    if (now - times[0] < 1000 * seconds) return requestAnimationFrame(frame);
    const gaps = times.slice(1).map((time, place) => time - times[place]).sort((a, b) => a - b);
    done({ rate: (1000 * gaps.length) / (now - times[0]), slow: gaps[Math.floor(0.95 * gaps.length)] });
  };
  requestAnimationFrame(frame);
})"""

_TIMED_FRAMES = """(() => {
  const request = window.requestAnimationFrame.bind(window);
  window.scriptTimes = [];
  window.requestAnimationFrame = (paint) => request((now) => {
    const started = performance.now();
    paint(now);
    window.scriptTimes.push(performance.now() - started);
  });
})()"""
"""Measures the script of every frame [ms]; for pages that are opened later."""

_PAINT = "performance.getEntriesByName('first-contentful-paint')[0].startTime / 1000"

_SHOWN = """(where) => document.querySelector('#table').dataset.where === where"""

_CONDITIONS = [f"ego_distance > {limit} AND num_objects > {3 * limit}" for limit in range(10, 45, 5)]


def figures(recordings: Path | None) -> Iterator[Figure]:
    """Benchmarks of the report and of the browser's page; on recorded scenarios if available."""
    with tempfile.TemporaryDirectory() as folder:
        lake = recorded_lake(Path(folder), recordings)
        took = json.loads(in_fresh_process(_REPORT, str(lake.root), f"{folder}/report.html"))
        yield Figure("report of 1,000 scenarios", took["wall"], "s", "<= 60")
        yield Figure("report of 1,000 scenarios, time of the processor", took["cpu"], "s", "<= 60")
    with launched() as browser:
        yield from _table(browser)
        yield from _player(browser)


def _table(browser: Any) -> Iterator[Figure]:
    with tempfile.TemporaryDirectory() as folder:
        write_metadata_lake(Path(folder), 1_000_000)
        with serving(Lake(folder)) as address:
            page = browser.new_page(viewport={"width": 1280, "height": 800})
            paints, tables = [], []
            for _ in range(5):
                started = time.perf_counter()
                page.goto(address)
                page.wait_for_selector("tbody tr")
                tables.append(time.perf_counter() - started)
                paints.append(page.evaluate(_PAINT))
            yield Figure("browse 1,000,000 rows: first paint", median(paints), "s", "<= 1")
            yield Figure("browse 1,000,000 rows: the first rows are there", median(tables), "s")
            filters = [_seconds_to_filter(page, condition) for condition in _CONDITIONS]
            yield Figure("browse 1,000,000 rows: filter, from Enter to the rows", median(filters), "s", "<= 0.5")
        busy = median(_busy_filtering(Lake(folder)))
        yield Figure("browse 1,000,000 rows: filter, time of the processor", busy, "s", "<= 0.5")


def _busy_filtering(lake: Lake) -> Iterator[float]:
    """The server's work for a page, without the browser."""
    known = {column.name: column for column in rows.columns(lake)}
    for condition in _CONDITIONS:
        started = time.process_time()
        rows.read_page(
            lake, rows.PageQuery(condition, "scenario_id", False, 0, 50, ("ego_distance", "num_objects")), known
        )
        yield time.process_time() - started


def _seconds_to_filter(page: Any, condition: str) -> float:
    page.fill("#where", condition)
    started = time.perf_counter()
    page.keyboard.press("Enter")
    while not page.evaluate(_SHOWN, condition):
        page.wait_for_timeout(5)
    return time.perf_counter() - started


def _player(browser: Any) -> Iterator[Figure]:
    scenario = make_scenario(1, num_objects=150, num_steps=200, num_lanes=60)
    with tempfile.TemporaryDirectory() as folder, serving(write_lake(folder, [scenario])) as address:
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.goto(f"{address}/?{urlencode({'scenario': scenario.id})}")
        page.wait_for_selector("#player canvas")
        page.get_by_role("button", name="Play", exact=True).click()
        for view, key in (("", None), (", following the ego", "f")):
            if key:
                page.keyboard.press(key)
            found = page.evaluate(_FRAMES, 4)
            yield Figure(f"play 150 objects{view}: frames", found["rate"], "1/s", ">= 30")
            yield Figure(f"play 150 objects{view}: 19 of 20 frames take at most", found["slow"], "ms", "<= 33.4")
        page.close()
        yield from _space(browser, f"{address}/?{urlencode({'scenario': scenario.id, 'look': '3d', 'follow': '1'})}")


def _space(browser: Any, address: str) -> Iterator[Figure]:
    page = browser.new_page(viewport={"width": 1280, "height": 800})
    page.add_init_script(_TIMED_FRAMES)
    page.goto(address)
    page.wait_for_selector("#player canvas")
    page.get_by_role("button", name="Play", exact=True).click()
    page.evaluate("scriptTimes.length = 0")
    found = page.evaluate(_FRAMES, 4)
    yield Figure("play 150 objects in space: script of a frame", median(page.evaluate("scriptTimes")), "ms", "<= 8")
    yield Figure("play 150 objects in space: frames of a software renderer", found["rate"], "1/s")
