"""How an environment is looked at: pictures as arrays, or a window."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import gymnasium

from scenarionet_data.arrays.dtypes import UInt8
from scenarionet_data.errors import BadParameter

if TYPE_CHECKING:
    from scenarionet_sim.environments.batched import BatchedEnvironment
    from scenarionet_sim.render.live import Live

METADATA: dict[str, Any] = {"render_modes": ["rgb_array", "human"], "render_fps": 10}


class View:
    """What ``render`` does in one of Gymnasium's modes, from above the ego; drawn by ``render``, which it imports late.

    Args:
        mode: ``rgb_array``, ``human`` or None.

    Raises:
        BadParameter: There is no such mode.
    """

    def __init__(self, mode: str | None) -> None:
        if mode is not None and mode not in METADATA["render_modes"]:
            raise BadParameter(f"render_mode {mode!r}; there are {', '.join(METADATA['render_modes'])}")
        self.mode = mode
        self._live: Live | None = None

    def render(self, core: BatchedEnvironment) -> UInt8 | None:
        """The moment as a picture (H, W, 3), or None when it is shown in a window.

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
        if self.mode == "rgb_array":
            return picture
        self._live.show(picture)
        return None

    def follow(self, core: BatchedEnvironment) -> None:
        """After every step and reset: a window shows it by itself."""
        if self.mode == "human":
            self.render(core)

    def close(self) -> None:
        """Close the window."""
        if self._live is not None:
            self._live.close()
            self._live = None
