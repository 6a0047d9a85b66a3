"""Planners of others in an environment with their packages (`make test-planners`)."""
