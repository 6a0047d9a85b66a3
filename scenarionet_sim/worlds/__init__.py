"""Scenarios as arrays: one world, a batch of worlds, and the state of everything that moves."""
