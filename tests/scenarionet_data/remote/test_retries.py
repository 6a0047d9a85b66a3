"""Requests whose connection is reset, whose answer is lost or cut off: repeated until the answer is whole."""

from __future__ import annotations

import re
import time
import uuid

import pytest

from scenarionet_data.errors import LakeError
from scenarionet_data.storage.files.object_store import ObjectStore
from scenarionet_data.storage.files.places import open_files
from tests.fixtures.object_store import BUCKET

pytestmark = pytest.mark.integration

CONTENT = bytes(range(256)) * 400
FAULTS = ("reset", "lost", "cut")

REQUESTS = {
    "download": lambda bucket, folder: (bucket.download("a", folder / "a").size, (folder / "a").read_bytes()),
    "pieces": lambda bucket, _: b"".join(bucket.pieces("a")),
    "range": lambda bucket, _: bytes(bucket.range("a", 10, 5000)),
    "range beyond the end": lambda bucket, _: bytes(bucket.range("a", 100_000, 200_000)),
    "last": lambda bucket, _: bucket.last("a", 1000),
    "find": lambda bucket, _: (bucket.find("a").size, bucket.find("nothing")),
    "list": lambda bucket, _: [each.name for each in bucket.list(".")[0]],
    "walk": lambda bucket, _: [each.name for each in bucket.walk()],
    "put": lambda bucket, _: bucket.put("b", CONTENT),
    "put in parts": lambda bucket, _: bucket.put("c", CONTENT * 60),
    "create": lambda bucket, _: bucket.create("new", CONTENT),
    "create a second time": lambda bucket, _: bucket.create("a", CONTENT),
    "delete": lambda bucket, _: (bucket.put("d", b"d"), bucket.delete(["d", "nothing"]), bucket.find("d"))[2],
}


@pytest.fixture
def fresh(store):
    """Make a bucket folder that contains one file."""

    def make():
        bucket = ObjectStore(f"s3://{BUCKET}/{uuid.uuid4().hex}")
        bucket.put("a", CONTENT)
        return bucket

    return make


@pytest.mark.parametrize("failures", [1, pytest.param(6, marks=pytest.mark.long)])
@pytest.mark.parametrize("request_name", REQUESTS)
def test_result_is_that_of_an_undisturbed_request(fresh, store, tmp_path, request_name, failures):
    request = REQUESTS[request_name]
    expected = request(fresh(), tmp_path)
    for fault in FAULTS:
        bucket = fresh()
        store.set(failures=failures, fault=fault)
        assert request(bucket, tmp_path) == expected, fault
        assert len(store.requests()) > failures


def test_only_the_rest_of_a_file_is_requested_again(fresh, store, tmp_path):
    bucket = fresh()
    store.set(failures=1, fault="cut")
    bucket.download("a", tmp_path / "a")
    assert (tmp_path / "a").read_bytes() == CONTENT
    assert [(method, bytes_) for method, _, bytes_ in store.requests()] == [
        ("GET", ""),
        ("GET", f"bytes={len(CONTENT) // 2}-{len(CONTENT) - 1}"),
    ]


def test_file_of_a_rival_is_not_ours_although_our_answer_was_lost(fresh, store):
    mine, rival = fresh(), fresh()
    rival = ObjectStore(mine.url)
    store.set(failures=1, fault="lost", method="PUT")
    assert mine.create("x", CONTENT)  # it finds its own file
    assert not rival.create("x", CONTENT)  # the content is the same
    store.set(failures=1, fault="lost", method="PUT")
    assert not rival.create("x", CONTENT)


@pytest.mark.parametrize("fault", FAULTS)
def test_message_states_the_time_waited(fresh, store, monkeypatch, fault):
    monkeypatch.setenv("SCENARIONET_PATIENCE", "0.5")
    bucket = fresh()
    store.set(failures=10_000, fault=fault)
    started = time.monotonic()
    with pytest.raises(LakeError) as caught:
        bucket.last("a", 1000)
    taken = time.monotonic() - started
    stated = float(re.search(r"retried for (\S+) s \(\$SCENARIONET_PATIENCE is 0.5 s\)", str(caught.value))[1])
    assert 0.5 <= stated <= taken + 0.05
    assert "run the same command again" in str(caught.value)


def test_creation_that_was_given_up_may_have_happened(fresh, store, monkeypatch):
    monkeypatch.setenv("SCENARIONET_PATIENCE", "0.2")
    store.set(failures=10_000, fault="reset", method="PUT")
    with pytest.raises(LakeError, match=r"may have been created .* see whether it is there"):
        fresh_name = ObjectStore(f"s3://{BUCKET}/{uuid.uuid4().hex}")
        fresh_name.create("x", CONTENT)


def test_truncated_copies_are_downloaded_again(url, store):
    files = open_files(url)
    temporary = files.temporary()
    temporary.write_bytes(CONTENT)
    files.publish(temporary, "databases/x/1.parquet")
    copy = open_files(url).path("databases/x/1.parquet")
    copy.write_bytes(CONTENT[:1000])
    assert open_files(url).path("databases/x/1.parquet").read_bytes() == CONTENT


def test_invalid_requests_are_not_repeated(fresh, store):
    bucket = fresh()
    store.set(failures=1, status=400)
    with pytest.raises(LakeError, match=r"answers 400 .*doctor"):
        bucket.range("a", 0, 10)
    assert len(store.requests()) == 1
