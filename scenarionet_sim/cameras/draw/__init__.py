"""Kernels that draw frames: instances, triangles, ground, sky, light and labels."""
