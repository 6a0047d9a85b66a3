"""The names under which Gymnasium knows the environments; nothing of them is imported before one is made."""

from __future__ import annotations

import gymnasium

gymnasium.register(
    "ScenarioNet-v0",
    entry_point="scenarionet_sim.env:ScenarioNetEnv",
    vector_entry_point="scenarionet_sim.vector:ScenarioNetVectorEnv",
)
