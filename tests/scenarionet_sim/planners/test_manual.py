"""Driving by keyboard and game pad: from keys and axes to actions, and a run without a window."""

from __future__ import annotations

import os
import struct

import numpy as np
import pytest

from scenarionet_data.errors import BadParameter
from scenarionet_sim.planners import manual
from scenarionet_sim.planners.manual import GamePad, Keyboard, KeyboardPlanner
from scenarionet_sim.planners.policy import Planned
from scenarionet_sim.policies.replay import Replay
from scenarionet_sim.simulation.simulation import Simulation
from scenarionet_sim.worlds.world import World
from tests.fixtures.drives import make_drive


def test_held_keys_steer_and_drive():
    keys = Keyboard()
    assert list(keys.action(0.0, 0.1)) == [0.0, 0.0]
    keys.press("left")
    keys.press("w")
    steering = [keys.action(0.0, 0.1)[0] for _ in range(4)]
    np.testing.assert_allclose(steering, [0.4, 0.8, 1.0, 1.0])
    assert keys.action(20.0, 0.1) == pytest.approx([0.6, 0.7]), "less at speed, gradually"
    keys.release("left")
    keys.press(" ")
    assert keys.action(0.0, 0.1) == pytest.approx([0.2, -1.0])
    assert not keys.has_ended
    keys.press("escape")
    assert keys.has_ended


def test_axes_of_a_game_pad(tmp_path):
    device = tmp_path / "js0"
    os.mkfifo(device)
    pad = GamePad(device)
    assert list(pad.action(0.0, 0.1)) == [0.0, 0.0]
    with device.open("wb", buffering=0) as events:
        for value, kind, number in ((-32767, 0x02, 0), (32767, 0x82, 5), (1, 0x01, 0), (100, 0x02, 7)):
            events.write(struct.pack("<IhBB", 0, value, kind, number))
        assert list(pad.action(0.0, 0.1)) == [1.0, 1.0]
        events.write(struct.pack("<IhBB", 0, 32767, 0x02, 2))
        assert list(pad.action(0.0, 0.1)) == [1.0, 0.0]
    with pytest.raises(BadParameter, match=r"js9: no game pad .*; connect one, or use the keyboard"):
        GamePad(tmp_path / "js9")


class Screen:
    """A window that shows nothing."""

    is_closed = False

    def __init__(self) -> None:
        self.shown = 0

    def picture(self, world, state, slot):
        return state.position[slot, world.ego].copy()

    def show(self, picture):
        self.shown += 1

    def wait(self, seconds):
        assert seconds > 0.0


def test_keys_move_the_ego(monkeypatch):
    screen, keys = Screen(), Keyboard()
    monkeypatch.setattr(manual, "window", lambda: screen)
    monkeypatch.setattr(manual, "keyboard", lambda: keys)
    keys.press("up")
    world = World.from_scenario(make_drive("manual", speed=5.0))
    simulation = Simulation([world], (Replay(), Planned(planner=KeyboardPlanner)), has_passengers=True)
    for _ in range(10):
        simulation.step()
    assert screen.shown == 10
    assert simulation.state.velocity[0, 0, 0] == pytest.approx(5.0 + 0.7 * 4.0, rel=0.01)
    screen.is_closed = True
    with pytest.raises(KeyboardInterrupt):
        simulation.step()
