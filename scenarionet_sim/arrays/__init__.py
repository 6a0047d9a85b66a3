"""The arrays that kernels share, and the plane geometry of boxes and polygons."""
