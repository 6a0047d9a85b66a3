"""An S3 server of their own for the tests of object stores."""

from __future__ import annotations

import uuid
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.fixtures import object_store
from tests.fixtures.object_store import BUCKET, ObjectStore


@pytest.fixture(scope="session")
def server() -> Iterator[ObjectStore]:
    with object_store.serve() as running:
        yield running


@pytest.fixture
def store(server: ObjectStore, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ObjectStore:
    """The server, well again, and this process as its client."""
    server.set()
    for name, value in (server.environment | {"SCENARIONET_CACHE": str(tmp_path / "cache")}).items():
        monkeypatch.setenv(name, value)
    monkeypatch.setenv("SCENARIONET_PATIENCE", "20")
    return server


@pytest.fixture
def url(store: ObjectStore) -> str:
    """Where there is no lake yet."""
    return f"s3://{BUCKET}/{uuid.uuid4().hex}/lake"
