"""Tests of openpilot's protocol need msgq and a checkout's schema; other test runs do not collect them."""

from __future__ import annotations

from importlib.util import find_spec

collect_ignore_glob = [] if find_spec("capnp") else ["test_*.py"]
