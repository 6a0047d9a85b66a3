"""Location of real recordings, and an S3 server for tests that request one."""

from __future__ import annotations

import gc
import os
import resource
import uuid
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import Phase, settings

from tests.fixtures import object_store
from tests.fixtures.object_store import BUCKET, ObjectStore

# No deadlines: the duration of an example depends on the machine.
settings.register_profile("quick", deadline=None, max_examples=20)
settings.register_profile("thorough", deadline=None, max_examples=100)
# The same examples for each mutant, and none sought that is simpler than one that fails.
settings.register_profile(
    "mutants", deadline=None, max_examples=20, derandomize=True, phases=[Phase.explicit, Phase.generate]
)
settings.load_profile(os.environ.get("SCENARIONET_HYPOTHESIS", "quick"))

# Compare the arguments of every call of a kernel that skips this otherwise, here and in subprocesses.
os.environ.setdefault("SCENARIONET_CHECK_KERNELS", "1")  # before modules of tests import compiled functions


gc.disable()  # until everything is collected: modules and test items stay until the end of the run


def pytest_collection_finish() -> None:
    """Exempt existing objects from garbage collection, which would otherwise take 5 % of the run's processor time."""
    gc.freeze()
    gc.enable()


def pytest_unconfigure(config: pytest.Config) -> None:
    """Print the processor time of the run, including pytest-xdist's workers and all subprocesses.

    Runs after the workers have ended: the operating system counts only children that have been waited for.
    """
    gc.unfreeze()  # temporary objects remaining at exit would be reported as a leak
    if hasattr(config, "workerinput") or config.option.collectonly:
        return
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    seconds = sum(each.ru_utime + each.ru_stime for each in used)
    config.get_terminal_writer().line(f"processor time of all processes: {seconds:.0f} s")


@pytest.fixture(scope="session")
def recordings() -> Path:
    """Folder of real recordings; skip the test if there is none."""
    folder = os.environ.get("SCENARIONET_TEST_DATA")
    if not folder:
        pytest.skip("real recordings: set SCENARIONET_TEST_DATA to their folder")
    return Path(folder)


@pytest.fixture(scope="session")
def object_store_server() -> Iterator[ObjectStore]:
    with object_store.serve() as running:
        yield running


@pytest.fixture
def store(object_store_server: ObjectStore, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ObjectStore:
    """The server without injected faults, and this process as its client."""
    object_store_server.set()
    for name, value in (object_store_server.environment | {"SCENARIONET_CACHE": str(tmp_path / "cache")}).items():
        monkeypatch.setenv(name, value)
    monkeypatch.setenv("SCENARIONET_PATIENCE", "20")
    return object_store_server


@pytest.fixture
def url(store: ObjectStore) -> str:
    """URL of a lake that does not exist yet."""
    return f"s3://{BUCKET}/{uuid.uuid4().hex}/lake"
