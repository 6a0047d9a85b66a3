"""Cameras: the scene of a world in space, lenses, light and presets, drawn by ``cameras.draw``."""
