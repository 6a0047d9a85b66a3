"""Agents of CARLA's leaderboard as planners: sensors as they ask for them, their control as an action, no world."""
