"""Sensors of agents: frozen specifications that read the arrays of a batch and a state."""
