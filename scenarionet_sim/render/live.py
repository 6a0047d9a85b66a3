"""Live view of a simulation: images with trails, or a window."""

from __future__ import annotations

from collections import deque
from typing import Any

from scenarionet_data.arrays.dtypes import UInt8
from scenarionet_data.errors import BadParameter
from scenarionet_data.plots import Moment, TopDown, Window
from scenarionet_data.plots.topdown import TRAIL
from scenarionet_sim.render.scenes import moment_of, scene_of
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world import World


class Live:
    """Follows the ego of one slot of a simulation, episode after episode.

    Args:
        width: Width of the view [m].
        size: Side of an image [pixels].

    Example:
        live = Live()
        picture = live.picture(world, simulation.state)  # after every step
    """

    def __init__(self, width: float = 100.0, size: int = 800) -> None:
        self._window = Window(0.0, 0.0, width, width)
        self._size = size
        self._view: TopDown | None = None
        self._world: World | None = None
        self._moments: deque[Moment] = deque(maxlen=TRAIL)
        self._image: Any = None

    def picture(self, world: World, state: State, slot: int = 0) -> UInt8:
        """Return the current moment as (H, W, 3) uint8; a timestep not later than the last one begins a new episode."""
        if self._view is None or self._world is not world:
            self._view, self._world = TopDown(scene_of(world), self._window, self._size), world
            self._moments.clear()
        now = moment_of(world, state, slot)
        if self._moments and now.timestep <= self._moments[-1].timestep:
            self._moments.clear()
        self._moments.append(now)
        return self._view.frame(self._moments)

    def show(self, picture: UInt8) -> None:
        """Show an image in a window; a window that the user closes stays closed.

        Raises:
            BadParameter: No display is available.
        """
        from matplotlib import pyplot

        if self._image is None:
            _require_display()
            figure = pyplot.figure("ScenarioNet", figsize=(self._size / 100, self._size / 100))
            axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
            axes.set_axis_off()
            self._image = axes.imshow(picture)
            figure.show()
        if not pyplot.fignum_exists(self._image.figure.number):
            return
        self._image.set_data(picture)
        self._image.figure.canvas.draw_idle()
        self._image.figure.canvas.flush_events()

    def close(self) -> None:
        """Close the window, if one is open."""
        if self._image is not None:
            from matplotlib import pyplot

            pyplot.close(self._image.figure)
            self._image = None


def _require_display() -> None:
    """Raise BadParameter unless matplotlib can open windows."""
    from matplotlib import pyplot

    try:
        can_open = pyplot.get_backend().lower() != "agg"
    except ImportError:  # an interactive backend was requested without a display
        can_open = False
    if not can_open:
        raise BadParameter(
            "a window needs a display and a GUI toolkit such as tkinter; without them use render_mode='rgb_array'"
        )
