"""Scenic programs on this simulator: ``scenarionet_sim.bridges.scenic.model`` is their model. Needs Scenic 3.1."""
