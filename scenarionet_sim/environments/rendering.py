"""Rendering of environments: image arrays, or a window."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import gymnasium

from scenarionet_data.arrays.dtypes import UInt8
from scenarionet_data.errors import BadParameter

if TYPE_CHECKING:
    from scenarionet_sim.environments.batched import BatchedEnvironment
    from scenarionet_sim.render.live import Live

METADATA: dict[str, Any] = {"render_modes": ["rgb_array", "human"], "render_fps": 10}


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
        self._live: Live | None = None

    def render(self, core: BatchedEnvironment) -> UInt8 | None:
        """Return the current moment as an image (H, W, 3), or show it in a window and return None.

        Raises:
            MissingDependency: matplotlib is not installed.
        """
        if self.mode is None:
            gymnasium.logger.warn("render needs an environment that was made with render_mode='rgb_array' or 'human'")
            return None
        if self._live is None:
            from scenarionet_sim.render.live import Live

            self._live = Live()
        picture = self._live.picture(core.simulation.batch.worlds[0], core.simulation.state)
        if not self.is_window:
            return picture
        self._live.show(picture)
        return None

    def close(self) -> None:
        """Close the window."""
        if self._live is not None:
            self._live.close()
            self._live = None
