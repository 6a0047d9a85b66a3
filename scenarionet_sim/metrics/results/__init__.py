"""Metrics of the table ``results``: each module measures episodes, as some of the columns.

A new metric is a module here, and its columns in ``schemas/results.toml``. The module has ``measure``, from an episode
to values by column, or ``measure_together``, from whole episodes on one map to columns, of arrays or lists.
"""
