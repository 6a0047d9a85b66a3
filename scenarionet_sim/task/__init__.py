"""Reward and termination, running counts, and who of the agents is judged."""
