"""Drive yourself, with the keyboard or a game pad, in a window and in real time.

``scenarionet sim lake driven --policy keyboard --name mine`` records it as a run like any other.
"""

from __future__ import annotations

import os
import struct
import time
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from scenarionet_data.errors import BadParameter
from scenarionet_sim.planners.base import Action, Planner
from scenarionet_sim.planners.view import View

if TYPE_CHECKING:
    from scenarionet_sim.render.live import Live

_LEFT, _RIGHT, _FORWARD, _BACK = ({"left", "a"}, {"right", "d"}, {"up", "w"}, {"down", "s", " "})
_QUICKEST = 4.0  # [1/s] change of the steering while a key is held
_EVENT = struct.Struct("<IhBB")  # time, value, type, number: linux/joystick.h
_AXIS, _INITIAL = 0x02, 0x80
_STEERING_AXIS, _BRAKE_AXIS, _THROTTLE_AXIS = 0, 2, 5  # left stick, left and right trigger of an Xbox pad
_FULL = 32767.0


class Keyboard:
    """Steering and throttle from the keys that are held: arrows or W, A, S, D; the space bar brakes, Escape ends.

    Attributes:
        has_ended: Escape was pressed.
    """

    def __init__(self) -> None:
        self._held: set[str] = set()
        self._steering = 0.0
        self.has_ended = False

    def press(self, key: str | None) -> None:
        """Note that a key is held."""
        self._held.add(str(key))
        self.has_ended |= key == "escape"

    def release(self, key: str | None) -> None:
        """Note that a key is no longer held."""
        self._held.discard(str(key))

    def action(self, speed: float, dt: float) -> Action:
        """Return steering and throttle; the wheel turns gradually, and less at speed."""
        wanted = (bool(self._held & _LEFT) - bool(self._held & _RIGHT)) / (1.0 + abs(speed) / 5.0)
        reach = _QUICKEST * dt
        self._steering += min(max(wanted - self._steering, -reach), reach)
        return [self._steering, -1.0 if self._held & _BACK else 0.7 * bool(self._held & _FORWARD)]


class GamePad:
    """Steering and throttle from a game pad of Linux: left stick, right trigger to accelerate, left one to brake.

    Args:
        device: File of the device.

    Raises:
        BadParameter: There is no such device.
    """

    def __init__(self, device: str | Path = "/dev/input/js0") -> None:
        try:
            self._file = os.open(device, os.O_RDONLY | os.O_NONBLOCK)
        except OSError as error:
            raise BadParameter(f"{device}: no game pad ({error.strerror}); connect one, or use the keyboard") from error
        self._axes = {_STEERING_AXIS: 0.0, _BRAKE_AXIS: -1.0, _THROTTLE_AXIS: -1.0}

    def action(self, speed: float, dt: float) -> Action:
        """Return steering and throttle as the axes are now."""
        del speed, dt
        try:
            content = os.read(self._file, 256 * _EVENT.size)
        except BlockingIOError:  # nothing since the last call
            content = b""
        for _, value, kind, number in _EVENT.iter_unpack(content[: len(content) // _EVENT.size * _EVENT.size]):
            if kind & ~_INITIAL == _AXIS and number in self._axes:
                self._axes[number] = value / _FULL
        throttle, brake = (0.5 * (1.0 + self._axes[axis]) for axis in (_THROTTLE_AXIS, _BRAKE_AXIS))
        return [-self._axes[_STEERING_AXIS], throttle - brake]


class KeyboardPlanner(Planner):
    """Shows the scene from above in a window and drives by the keys held there; needs a display."""

    pace = 1.0
    """Seconds of a simulated second."""

    def __init__(self) -> None:
        self._due = 0.0

    def act(self, view: View) -> Action:
        """Show the moment, wait until it is over, and return steering and throttle.

        Raises:
            KeyboardInterrupt: Escape was pressed, or the window was closed.
        """
        live = window()
        live.show(live.picture(view.world, view.state, view.slot))
        now = time.monotonic()
        self._due = max(self._due, now) + view.dt * self.pace
        live.wait(self._due - now)
        if keyboard().has_ended or live.is_closed:  # windows do not pass on what their listeners raise
            raise KeyboardInterrupt
        return self.controls().action(view.ego.speed, view.dt)

    def controls(self) -> Keyboard | GamePad:
        """Return what it is driven by."""
        return keyboard()


class GamePadPlanner(KeyboardPlanner):
    """Like :class:`KeyboardPlanner`, with the first game pad."""

    def controls(self) -> Keyboard | GamePad:
        """Return the game pad."""
        return game_pad()


@cache
def window() -> Live:
    """Return the window of this process; it stays open from scenario to scenario."""
    from scenarionet_sim.render.live import Live  # needs matplotlib, which other drivers do not

    live, keys = Live(), keyboard()
    live.on_keys(keys.press, keys.release)
    return live


@cache
def keyboard() -> Keyboard:
    """Return the keyboard of the window."""
    return Keyboard()


@cache
def game_pad() -> GamePad:
    """Return the first game pad."""
    return GamePad()
