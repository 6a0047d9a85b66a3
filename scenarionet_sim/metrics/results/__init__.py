"""Metrics of the table ``results``: each module has ``measure``, from an episode to some of the columns.

A new metric is a module here, and its columns in ``schemas/results.toml``.
"""
