"""The names under which Gymnasium knows the environments; nothing of them is imported before one is made."""

from __future__ import annotations

import gymnasium

gymnasium.register(
    "ScenarioNet-v0",
    entry_point="scenarionet_sim.environments.single_agent:ScenarioNetEnv",
    vector_entry_point="scenarionet_sim.environments.vector:ScenarioNetVectorEnv",
)
