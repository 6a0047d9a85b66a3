"""What this installation knows of an object store: endpoint, credentials, and whether a lake can be written there."""

from __future__ import annotations

import os
import uuid
from collections.abc import Iterator

from scenarionet_data import Lake
from scenarionet_data.errors import NoSuchSnapshot, ScenarioNetError
from scenarionet_data.storage.files import cache, object_store
from scenarionet_data.storage.files.opening import open_files
from scenarionet_pipelines.doctor.local import Finding

_CREDENTIALS = {
    "s3": ("AWS_ACCESS_KEY_ID", "AWS_PROFILE", "AWS_WEB_IDENTITY_TOKEN_FILE", "AWS_CONTAINER_CREDENTIALS_RELATIVE_URI"),
    "gs": ("GOOGLE_APPLICATION_CREDENTIALS", "GOOGLE_SERVICE_ACCOUNT", "GOOGLE_SERVICE_ACCOUNT_KEY"),
}


def examine_store(url: str) -> Iterator[Finding]:
    """Look at what is set for an object store, then at the store, then at the lake.

    A file is put there and removed again: stores differ in whether they refuse a second one of the same name, and
    commits need that they do.
    """
    scheme = url.partition("://")[0]
    if scheme == "s3":
        region = os.environ.get("AWS_REGION") or os.environ.get("AWS_DEFAULT_REGION") or "us-east-1"
        yield Finding("store", "endpoint", "ok", f"{object_store.endpoint() or 'Amazon'}, region {region}")
    found = [name for name in _CREDENTIALS.get(scheme, ()) if os.environ.get(name)]
    remedy = "" if found else f"set {_CREDENTIALS.get(scheme, ('what it needs',))[0]} unless this machine has a role"
    yield Finding("store", "credentials", "ok" if found else "missing", ", ".join(found) or "none are set", remedy)
    copies = cache.folder_of(url).parent
    yield Finding("store", "copies", "ok", f"{copies}, up to {cache.room() / 1e9:,.0f} GB ($SCENARIONET_CACHE_GB)")
    try:
        yield _lake(url)
        yield _writing(url)
    except ScenarioNetError as error:
        yield Finding("store", url, "bad", str(error), "see above what is set")


def _lake(url: str) -> Finding:
    try:
        lake = Lake(url)
        return Finding("lake", url, "ok", f"snapshot {lake.snapshot.number}, {len(lake):,} scenarios")
    except NoSuchSnapshot:
        return Finding("lake", url, "missing", "no lake there", f"scenarionet convert DATASET RAW {url}")


def _writing(url: str) -> Finding:
    files, name = open_files(url), f".doctor/{uuid.uuid4().hex}"
    made = [files.publish_new(name, b"") for _ in range(2)]
    files.remove(name)
    if made == [True, False]:
        return Finding("lake", "writing", "ok", f"{url} can be written, and a file is put there only once")
    remedy = "commit from one client at a time, or use a store that knows If-None-Match: *"
    return Finding("lake", "writing", "bad", f"{url} lets a second file take the place of the first", remedy)
