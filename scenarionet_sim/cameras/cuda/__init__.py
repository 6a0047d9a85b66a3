"""Cameras on a graphics card: ``kernels.cameras`` compiled by numba-cuda, and frames that stay in its memory."""
