"""Numba kernels over plain arrays, independent of the classes of the simulator."""
