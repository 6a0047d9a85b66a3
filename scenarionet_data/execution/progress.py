"""The progress callback that every long operation accepts as ``on_progress``."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[int, int, int], None]
"""Called with steps done, steps in total, and scenarios done (0 where steps do not contain scenarios).

A step is a shard, a bin, a file, a check or a part; see the docstring of the operation.
"""
