"""Compiled loops of cameras: lenses, triangles in view, the ground, shading, whole frames."""
