"""Clips to download: the recording and runs side by side, drawn as ``scenarionet render`` draws them.

A clip is sent as lines of JSON, one per finished frame (``{"done": 3, "of": 90}``), then ``{"size": n}``, then the n
bytes of the file; a failure is a last line ``{"error": "..."}``. ``static/clip.js`` reads it.
"""

from __future__ import annotations

import json
import queue
import tempfile
import threading
from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from scenarionet_data import Lake, resample
from scenarionet_data.arrays.dtypes import UInt8
from scenarionet_data.errors import ScenarioNetError
from scenarionet_data.plots import Moment, Scene, TopDown
from scenarionet_data.plots.drawing import until
from scenarionet_data.plots.files import write_video
from scenarionet_data.plots.scene import Window
from scenarionet_data.scenario.description import ScenarioDescription

KINDS = ("mp4", "gif") if find_spec("av") else ("gif",)
"""Kinds of files that this installation writes, the smaller ones first."""

_WIDTH = 80.0
"""Width of the view [m]."""

_SIDES = {1: 640, 2: 480}
_SIDE = 400
"""Side of a picture beside two or more others [pixel]."""

_CAPTION = 28  # [pixel]
_rendering = threading.Lock()  # matplotlib holds the interpreter: two clips at a time would finish no sooner


class _Abandoned(Exception):
    """The client no longer waits for the clip."""


def stream_clip(
    lake: Lake, scenario: ScenarioDescription, runs: Sequence[tuple[str, int]], kind: str
) -> Iterator[bytes]:
    """Draw a clip; yield its progress and then its content, see the module.

    Args:
        lake: The lake with the runs.
        scenario: The scenario.
        runs: Name and number of each rollout to show beside the recording.
        kind: One of KINDS.
    """
    messages: queue.Queue[bytes | None] = queue.Queue()
    is_abandoned = threading.Event()

    def say(message: dict[str, Any], content: bytes = b"") -> None:
        if is_abandoned.is_set():
            raise _Abandoned
        messages.put(json.dumps(message).encode() + b"\n" + content)

    def work() -> None:
        try:
            with _rendering:
                content = _render(lake, scenario, runs, kind, say)
            say({"size": len(content)}, content)
        except _Abandoned:
            pass
        except (ScenarioNetError, OSError) as error:
            messages.put(json.dumps({"error": str(error)}).encode() + b"\n")
        finally:
            messages.put(None)

    threading.Thread(target=work, daemon=True).start()
    try:
        while (message := messages.get()) is not None:
            yield message
    finally:
        is_abandoned.set()


def _render(lake: Lake, scenario: ScenarioDescription, runs: Sequence[tuple[str, int]], kind: str, say: Any) -> bytes:
    from scenarionet_sim.render.rollouts import rollout_moments
    from scenarionet_sim.worlds.world import STEP

    scene = Scene.of(resample(scenario, STEP))
    panels = {"recording": scene.moments()}
    for run, rollout in runs:
        panels[f"{run}, rollout {rollout}" if rollout else run] = rollout_moments(lake, run, scene, rollout)
    first = min(moments[0].timestep for moments in panels.values())
    last = max(moments[-1].timestep for moments in panels.values())
    count = last - first + 1

    def on_frame(done: int) -> None:
        say({"done": done, "of": count})

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"clip.{kind}"
        write_video(path, _frames(scene, panels, range(first, last + 1)), 1 / STEP, on_frame)
        return path.read_bytes()


def _frames(scene: Scene, panels: dict[str, list[Moment]], timesteps: range) -> Iterator[UInt8]:
    """Yield pictures (H, W, 3) of all panels; one that has no moment of a timestep shows its nearest."""
    side = _SIDES.get(len(panels), _SIDE)
    views = [TopDown(scene, Window(0.0, 0.0, _WIDTH, _WIDTH), side) for _ in panels]
    captions = np.concatenate([_caption(name, side) for name in panels], axis=1)
    for timestep in timesteps:
        pictures = []
        for view, moments in zip(views, panels.values(), strict=True):
            place = min(max(timestep - moments[0].timestep, 0), len(moments) - 1)
            pictures.append(view.frame(until(moments, place)))
        yield np.concatenate([captions, np.concatenate(pictures, axis=1)])


def _caption(name: str, side: int) -> UInt8:
    """A strip (H, side, 3) with a name."""
    from PIL import Image, ImageDraw, ImageFont

    strip = Image.new("RGB", (side, _CAPTION), "#ffffff")
    ImageDraw.Draw(strip).text((8, 6), name, "#22262a", ImageFont.load_default(14))
    return np.asarray(strip)
