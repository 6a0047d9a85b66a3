"""Tests of planners of others need their packages; other test runs do not collect them."""

from __future__ import annotations

from importlib.util import find_spec

collect_ignore_glob = [] if find_spec("commonroad_dc") else ["test_*.py"]
