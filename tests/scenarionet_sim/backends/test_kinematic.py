"""The kinematic backend: the behaviour suite, and the friction of roads."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scenarionet_sim.backends.base import Drive
from scenarionet_sim.backends.fleet import Fleet
from scenarionet_sim.backends.kinematic import Kinematic
from scenarionet_sim.policies.external import External
from scenarionet_sim.policies.replay import Replay
from scenarionet_sim.simulation.simulation import Simulation
from scenarionet_sim.worlds.world import World
from tests.fixtures.scenarios import make_scenario
from tests.scenarionet_sim.backends.conformance import BackendConformance


class TestKinematic(BackendConformance):
    backend = Kinematic()


@pytest.mark.parametrize("backend", [Kinematic(Drive()), Kinematic(Fleet(car=Drive()))])
def test_brakes_are_as_good_as_the_friction_of_the_road(backend):
    """Worlds of different friction beside each other, and one after another in the same slot."""
    scenario = make_scenario(1)
    dry, wet, icy = (
        World.from_scenario(replace(scenario, extras={**scenario.extras, "friction": friction}))
        for friction in (1.0, 0.5, 0.1)
    )
    simulation = Simulation([dry, icy], (Replay(), External()), backend)

    def lost(slots: int) -> list[float]:
        """Speed lost in half a second of full braking."""
        row, motion = simulation.batch.ego[0], simulation.state.motion
        motion[:, row, 3:7] = 0.0
        motion[:, row, 4] = 20.0
        for _ in range(5):
            simulation.step(np.tile([0.0, -1.0], (len(simulation.agents), 1)))
        return [20.0 - float(np.hypot(*simulation.state.motion[slot, row, 4:6])) for slot in range(slots)]

    grip = 8.0
    assert lost(2) == pytest.approx([0.5 * grip, 0.5 * 0.1 * grip], rel=0.2)
    simulation.reset(0, wet)
    simulation.reset(1, dry)
    assert lost(2) == pytest.approx([0.5 * 0.5 * grip, 0.5 * grip], rel=0.2)
    simulation.close()
