"""The map in the plane: segments, lanes and polygons, each under a grid."""
