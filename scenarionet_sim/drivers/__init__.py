"""Drivers by name: policies, planners and trained networks."""
