"""Make the pictures of the browser page in the documentation: ``python docs/make_page_pictures.py``; needs Chromium.

The lake of generated scenarios and the runs that they show are made in a temporary folder.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
import threading
from pathlib import Path
from urllib.parse import urlencode

from PIL import Image
from playwright.sync_api import Page, sync_playwright

from scenarionet_data import Lake, convert
from scenarionet_pipelines.web.server import Server
from scenarionet_sim import evaluate

FOLDER = Path(__file__).parent / "pictures"
SIZE = {"width": 1280, "height": 1010}

PAGES = {
    "browse": {"where": "num_objects > 5", "sort": "difficulty", "order": "falling", "charts": "ego_distance,duration"},
    "player": {"scenario": "pg/v2/9", "at": "9.00", "follow": "1", "camera": "chase"},
    "runs": {"scenario": "pg/v2/9", "at": "12.00", "runs": "idm,constant"},
    "space": {"scenario": "pg/v2/9", "at": "9.00", "follow": "1", "look": "3d"},
}
"""Name of each picture and the state in the address of its page."""


def ready(page: Page, state: dict[str, str]) -> None:
    """Wait until everything that a page shows is there."""
    page.wait_for_selector("#player .runs li" if "scenario" in state else "tbody img[src]")
    if "camera" in state:
        page.wait_for_selector("#player .seen canvas[aria-label]:not(.stale)")
    page.wait_for_timeout(4000)  # thumbnails and events arrive one after the other


if __name__ == "__main__":
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER
    with tempfile.TemporaryDirectory() as folder:
        convert("pg", "0:40", Path(folder) / "lake")
        lake = Lake(Path(folder) / "lake")
        for policy in ("idm", "constant"):
            evaluate(lake, policy=policy, backend="kinematic", name=policy)
        with Server(lake, port=0) as server, sync_playwright() as playwright:
            threading.Thread(target=server.run).start()
            chromium = playwright.chromium.launch(
                executable_path=shutil.which("chromium"),
                args=["--enable-unsafe-swiftshader", *(["--no-sandbox"] if os.geteuid() == 0 else [])],
            )
            page = chromium.new_page(viewport=SIZE)
            for name, state in PAGES.items():
                page.goto(f"{server.address}?{urlencode(state)}")
                ready(page, state)
                page.screenshot(path=target / f"{name}.png")
                picture = Image.open(target / f"{name}.png").convert("RGB")
                picture.quantize(256, dither=Image.Dither.NONE).save(target / f"{name}.png", optimize=True)
            chromium.close()
            server.stop()
