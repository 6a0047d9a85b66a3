"""Loops over plain arrays, compiled by numba: no scenario, no world, no object, only numbers."""
