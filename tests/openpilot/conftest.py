"""Tests of openpilot's protocol need msgq and a checkout's schema; other test runs do not collect them."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest

collect_ignore_glob = [] if find_spec("capnp") else ["test_*.py"]

needs_openpilot = pytest.mark.skipif(
    not find_spec("msgq") or not Path(os.environ.get("OPENPILOT", ""), "log.capnp").is_file(),
    reason="OPENPILOT'S PROTOCOL IS NOT TESTED: name a checkout of commaai/msgq in MSGQ for `make openpilot`, and "
    "a folder with log.capnp and services.py of openpilot in OPENPILOT",
)


@pytest.fixture(scope="session")
def queues() -> Iterator[None]:
    """Queues that no other openpilot of this machine has."""
    prefix = f"test{os.getpid()}"
    folder = Path("/dev/shm", f"msgq_{prefix}")
    folder.mkdir()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("OPENPILOT_PREFIX", prefix)
        yield
    shutil.rmtree(folder)
