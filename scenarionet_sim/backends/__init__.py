"""Backends: vehicle dynamics of the agents, one file each."""
