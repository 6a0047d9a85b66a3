"""What openpilot gets, as far as it needs none of its packages."""

from __future__ import annotations

import numpy as np
import pytest

from scenarionet_data.errors import BadParameter
from scenarionet_sim.bridges import stacks
from scenarionet_sim.bridges.openpilot.transport import between
from scenarionet_sim.bridges.sensing import nv12
from scenarionet_sim.planners.view import View
from scenarionet_sim.policies.replay import Replay
from scenarionet_sim.simulation.simulation import Simulation
from scenarionet_sim.worlds.world import World
from tests.fixtures.drives import Other, make_drive


def test_nv12_is_bt_601_within_a_level():
    picture = np.random.default_rng(0).integers(0, 256, (6, 8, 3), dtype=np.uint8)
    matrix = np.array([[65.481, 128.553, 24.966], [-37.797, -74.203, 112.0], [112.0, -93.786, -18.214]]) / 255.0
    luma = 16.0 + picture @ matrix[0]
    quarters = picture.reshape(3, 2, 4, 2, 3).mean((1, 3))
    chroma = 128.0 + quarters @ matrix[1:].T
    made = nv12(picture).astype(float)
    np.testing.assert_allclose(made[:48].reshape(6, 8), luma, rtol=0, atol=1.0)
    np.testing.assert_allclose(made[48:].reshape(3, 4, 2), chroma, rtol=0, atol=1.0)


def test_between_moments_what_is_there_moves_and_angles_take_the_short_way():
    world = World.from_scenario(make_drive(others=(Other(20.0, 3.5, vx=4.0), Other(40.0, 3.5, vx=4.0, first=1))))
    simulation = Simulation([world], (Replay(),))
    before = simulation.state
    before = type(before)(before.motion.copy(), before.route, before.present.copy(), before.size, before.object_type,
                          before.timestep)  # fmt: skip
    simulation.step()
    now = View(world, simulation.state, 0, world.ego)
    before.motion[0, 0, 3], simulation.state.motion[0, 0, 3] = 3.1, -3.1
    half = between(now, before, 0.5)
    assert half.ego.x == pytest.approx(0.5)
    assert abs(half.ego.heading) == pytest.approx(np.pi)
    assert half.objects.position[:, 0] == pytest.approx([20.2, 40.4])  # the second was not there before
    assert between(now, before, 1.0) is now


def test_without_a_checkout_it_says_so(monkeypatch):
    monkeypatch.delenv("OPENPILOT", raising=False)
    with pytest.raises(BadParameter, match="OPENPILOT names the folder of a checkout of openpilot; it is not set"):
        stacks.TRANSPORTS["openpilot:msgq"](())
