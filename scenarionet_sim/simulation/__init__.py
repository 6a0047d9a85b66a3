"""The simulation loop: one compiled step of many worlds, their agents, and what observes them."""
