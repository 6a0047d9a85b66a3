"""Rendering of environments: image arrays, or a window."""

from __future__ import annotations

import os
import sys
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import gymnasium

from scenarionet_data.arrays.dtypes import UInt8
from scenarionet_data.errors import BadParameter

if TYPE_CHECKING:
    from scenarionet_sim.environments.batched import BatchedEnvironment
    from scenarionet_sim.render.live import Live

METADATA: dict[str, Any] = {"render_modes": ["rgb_array", "human"], "render_fps": 10}
"""Of the classes; an environment has those of :func:`metadata_here`."""


def metadata_here() -> dict[str, Any]:
    """Return the metadata with the render modes that work on this machine: a window needs a display."""
    has_display = sys.platform != "linux" or any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))
    modes = ["rgb_array", *(["human"] if has_display else [])] if find_spec("matplotlib") else []
    return METADATA | {"render_modes": modes}


class Renderer:
    """``render`` of an environment, from above the ego; imports matplotlib on first use.

    Args:
        mode: ``rgb_array``, ``human`` or None.

    Raises:
        BadParameter: The mode is unknown.
    """

    def __init__(self, mode: str | None) -> None:
        if mode is not None and mode not in METADATA["render_modes"]:
            raise BadParameter(f"unknown render_mode {mode!r}; choose from {', '.join(METADATA['render_modes'])}")
        self.mode, self.is_window = mode, mode == "human"
        self._live: list[Live] = []

    def render(self, core: BatchedEnvironment) -> UInt8 | None:
        """Return the current moment as an image (H, W, 3), or show it in a window and return None.

        Raises:
            MissingDependency: matplotlib is not installed.
        """
        pictures = self.pictures(core, 1)
        if pictures is None or not self.is_window:
            return None if pictures is None else pictures[0]
        self._live[0].show(pictures[0])
        return None

    def pictures(self, core: BatchedEnvironment, count: int) -> tuple[UInt8, ...] | None:
        """Return images (H, W, 3) of the first ``count`` worlds; None without a render mode.

        Raises:
            MissingDependency: matplotlib is not installed.
        """
        if self.mode is None:
            gymnasium.logger.warn("render needs an environment that was made with render_mode='rgb_array' or 'human'")
            return None
        if len(self._live) < count:
            from scenarionet_sim.render.live import Live

            self._live += [Live() for _ in range(count - len(self._live))]
        worlds, state = core.simulation.batch.worlds, core.simulation.state
        return tuple(live.picture(worlds[slot], state, slot) for slot, live in enumerate(self._live[:count]))

    def close(self) -> None:
        """Close the window."""
        for live in self._live:
            live.close()
        self._live = []
