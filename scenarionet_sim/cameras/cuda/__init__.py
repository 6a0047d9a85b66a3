"""Cameras on a graphics card: ``cameras.draw`` compiled by numba-cuda, and frames that stay in its memory."""
