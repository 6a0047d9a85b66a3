"""Live view of a simulation: images with trails, or a window."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any

from scenarionet_data.arrays.dtypes import UInt8
from scenarionet_data.errors import BadParameter
from scenarionet_data.plots import Moment, TopDown, Window
from scenarionet_data.plots.topdown import TRAIL
from scenarionet_sim.render.scenes import moment_of, scene_of
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world import World

KeyListener = Callable[[str | None], None]
"""Gets the name of a key, as matplotlib calls it."""


class Live:
    """Follows the ego of one slot of a simulation, episode after episode.

    Args:
        width: Width of the view [m].
        size: Side of an image [pixels].

    Attributes:
        is_closed: The user has closed the window.

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
        self._keys: tuple[KeyListener, KeyListener] | None = None
        self.is_closed = False

    def on_keys(self, pressed: KeyListener, released: KeyListener) -> None:
        """Call functions with the name of each key that is pressed or released in the window, from its opening on."""
        self._keys = pressed, released

    def picture(self, world: World, state: State, slot: int = 0) -> UInt8:
        """Return the current moment as (H, W, 3) uint8; a timestep not later than the last one begins a new episode."""
        given: tuple[object, object] = (world, state)
        if not (isinstance(given[0], World) and isinstance(given[1], State)):
            found = " and ".join(type(each).__name__ for each in given)
            raise BadParameter(f"expected picture(world, simulation.state), found {found}")
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

        from scenarionet_sim.render.pixels import Pixels

        if self._image is None:
            try:
                can_open = pyplot.get_backend().lower() != "agg"
            except ImportError:  # an interactive backend was requested without a display
                can_open = False
            if not can_open:
                raise BadParameter(
                    "a window needs a display and a GUI toolkit such as tkinter; without them use "
                    "render_mode='rgb_array'"
                )
            with pyplot.rc_context({"toolbar": "None"}):
                figure = pyplot.figure("ScenarioNet", figsize=(self._size / 100, self._size / 100), dpi=100)
            figure.canvas.mpl_connect("close_event", lambda _: setattr(self, "is_closed", True))
            self._image = Pixels()
            figure.add_artist(self._image)
            if self._keys is not None:
                manager = figure.canvas.manager
                if manager is not None and manager.key_press_handler_id is not None:
                    figure.canvas.mpl_disconnect(manager.key_press_handler_id)  # keys of matplotlib's own
                figure.canvas.mpl_connect("key_press_event", partial(_tell, self._keys[0]))
                figure.canvas.mpl_connect("key_release_event", partial(_tell, self._keys[1]))
            figure.show()
            figure.canvas.flush_events()  # the window learns how dense the display is
            figure.set_size_inches(self._size / figure.dpi, self._size / figure.dpi)
        if self.is_closed:
            return
        self._image.set_picture(picture)
        self._image.figure.canvas.draw_idle()
        self._image.figure.canvas.flush_events()

    def wait(self, seconds: float) -> None:
        """Handle events of the window for a while [s]."""
        if self._image is not None and not self.is_closed:
            self._image.figure.canvas.start_event_loop(max(seconds, 1e-3))

    def close(self) -> None:
        """Close the window, if one is open."""
        if self._image is not None:
            from matplotlib import pyplot

            pyplot.close(self._image.figure)
            self._image, self.is_closed = None, False


def _tell(listener: KeyListener, event: Any) -> None:
    listener(event.key)
