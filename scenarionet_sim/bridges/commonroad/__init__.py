"""Planners of CommonRoad, which nobody here wrote: the scene as CommonRoad's objects, and what drives by them."""
