"""The kinematic backend: the behaviour suite."""

from __future__ import annotations

from scenarionet_sim.backends.kinematic import Kinematic
from tests.scenarionet_sim.backends.conformance import BackendConformance


class TestKinematic(BackendConformance):
    backend = Kinematic()
