"""Driving metrics: pure functions over the arrays of a rollout, one subject per file.

Definitions and thresholds follow published benchmarks where they exist; each file names its source. Lengths in metres,
times in seconds, angles in radians; T moments of an episode, N objects.
"""
