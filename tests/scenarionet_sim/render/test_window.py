"""The window, on a virtual display: it shows pictures as they are; keys, Escape and its closing reach the driver."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys

import pytest

pytestmark = pytest.mark.integration

_SCRIPT = """
import numpy as np
from scenarionet_sim.planners.manual import keyboard, window

live, keys = window(), keyboard()
picture = np.arange(800 * 800 * 3, dtype=np.uint32).reshape(800, 800, 3).astype(np.uint8)
live.show(picture)
canvas = live._image.figure.canvas
widget = canvas.get_tk_widget()
widget.focus_force()
live.wait(0.5)
live.show(picture)
shown = np.asarray(canvas.buffer_rgba())[..., :3]
print("same picture", np.array_equal(shown, picture))
for event in ("<KeyPress-Up>", "<KeyPress-Left>", "<KeyRelease-Up>"):
    widget.event_generate(event)
live.wait(0.2)
print("held", sorted(keys._held))
widget.event_generate("<KeyPress-Escape>")
live.wait(0.2)
print("ended", keys.has_ended, live.is_closed)
canvas.manager.window.destroy()
live.show(picture)
print("closed", live.is_closed)
"""


@pytest.fixture(scope="module")
def display():
    """A virtual display."""
    server = shutil.which("Xvfb")
    if not server:
        pytest.skip("no Xvfb: install it (apt install xvfb) for the tests of the window")
    pytest.importorskip("tkinter", reason="Python has no tkinter")
    reading, writing = os.pipe()
    command = [server, "-displayfd", str(writing), "-screen", "0", "1280x1024x24", "-nolisten", "tcp"]
    with subprocess.Popen(command, pass_fds=[writing], stderr=subprocess.DEVNULL) as process:
        os.close(writing)
        with os.fdopen(reading) as told:
            number = told.readline().strip()
        yield f":{number}"
        process.terminate()


def test_keys_reach_the_driver_and_pictures_the_window(display):
    environment = os.environ | {"DISPLAY": display, "MPLBACKEND": "tkagg"}
    done = subprocess.run([sys.executable, "-c", _SCRIPT], env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == [
        "same picture True", "held ['left']", "ended True False", "closed True"
    ]  # fmt: skip
