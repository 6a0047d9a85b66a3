"""Foxglove: recordings as MCAP."""
