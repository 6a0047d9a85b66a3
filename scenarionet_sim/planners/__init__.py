"""Planners: from a view of the world in metres to an action or a trajectory, and the trackers that follow it."""
