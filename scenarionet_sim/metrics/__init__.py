"""How well it was driven: small pure functions over the arrays of a rollout, one subject a file.

Definitions and thresholds are those of the field where it has some; each file names its source. Lengths in metres,
times in seconds, angles in radians; T moments of an episode, N objects.
"""
