"""Compilation with Numba: the decorators of all kernels; behind ``gate``, a compiler and a cache of our own."""
