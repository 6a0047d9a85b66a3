"""Compilation with Numba: the decorators of all kernels, and the compiler behind them."""
