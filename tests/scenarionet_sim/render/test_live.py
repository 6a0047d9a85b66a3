"""Conversion of simulations to plots, and live images."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from scenarionet_data.errors import BadParameter
from scenarionet_data.plots import Scene
from scenarionet_sim.render.live import Live
from scenarionet_sim.render.scenes import scene_of
from scenarionet_sim.simulation.simulation import Simulation
from scenarionet_sim.worlds.world import World
from tests.fixtures.drives import make_drive
from tests.fixtures.scenarios import make_scenario
from tests.fixtures.simulations import alone, generated


@pytest.mark.parametrize(
    "make",
    [partial(generated, 3), partial(make_scenario, 1), partial(alone, has_map=False)],
    ids=["pg", "made", "bare"],
)
def test_world_is_drawn_like_its_scenario(make):
    scenario = make()
    found, wanted = scene_of(World.from_scenario(scenario)), Scene.of(scenario)
    for name in ("object_type", "size", "present", "light_stop", "light_state"):
        np.testing.assert_array_equal(getattr(found, name), getattr(wanted, name), err_msg=name)
    np.testing.assert_array_equal(found.position[found.present], wanted.position[wanted.present])
    np.testing.assert_array_equal(found.route, wanted.route)
    for name in ("areas", "lanes"):
        assert getattr(found.map, name).is_equal(getattr(wanted.map, name)), name
    by_line = lambda shapes: sorted((int(k), p.tobytes()) for k, p in zip(shapes.line_type, shapes.lines, strict=True))  # noqa: E731
    assert by_line(found.map) == by_line(wanted.map)


def test_live_images_have_trails_until_the_next_episode():
    simulation = Simulation([World.from_scenario(make_drive())])
    live = Live(width=40, size=200)
    first = live.picture(simulation.batch.worlds[0], simulation.state)
    for _ in range(5):
        simulation.step([[0.0, 0.5]])
        later = live.picture(simulation.batch.worlds[0], simulation.state)
    assert not np.array_equal(first, later)
    simulation.reset(0)
    np.testing.assert_array_equal(live.picture(simulation.batch.worlds[0], simulation.state), first)
    simulation.reset(0, World.from_scenario(alone(has_map=False)))
    assert not np.array_equal(live.picture(simulation.batch.worlds[0], simulation.state), first)


def test_window_needs_a_display(monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "agg")
    import matplotlib

    matplotlib.use("agg")
    with pytest.raises(BadParameter, match="rgb_array"):
        Live().show(np.zeros((8, 8, 3), np.uint8))
