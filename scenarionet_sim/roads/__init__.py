"""The map in the plane: segments, lanes and polygons, with grids for look-up."""
