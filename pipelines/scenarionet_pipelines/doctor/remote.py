"""Checks of an object store: endpoint, credentials, local cache, and whether a lake can be written."""

from __future__ import annotations

import os
import uuid
from collections.abc import Iterator

from scenarionet_data import Lake
from scenarionet_data.errors import NoSuchSnapshot, ScenarioNetError
from scenarionet_data.storage.files import cache, store_client
from scenarionet_data.storage.files.places import open_files
from scenarionet_pipelines.doctor.finding import Finding

_CREDENTIALS = {
    "s3": ("AWS_ACCESS_KEY_ID", "AWS_PROFILE", "AWS_WEB_IDENTITY_TOKEN_FILE", "AWS_CONTAINER_CREDENTIALS_RELATIVE_URI"),
    "gs": ("GOOGLE_APPLICATION_CREDENTIALS", "GOOGLE_SERVICE_ACCOUNT", "GOOGLE_SERVICE_ACCOUNT_KEY"),
}


def examine_store(url: str) -> Iterator[Finding]:
    """Check the settings for an object store, the lake, and whether the store supports commits.

    A commit relies on the store refusing to create an object that exists. This is tested with a small object, which
    is deleted again.

    Args:
        url: URL of a lake; it need not exist.
    """
    scheme = url.partition("://")[0]
    if scheme == "s3":
        region = os.environ.get("AWS_REGION") or os.environ.get("AWS_DEFAULT_REGION") or "us-east-1"
        yield Finding("store", "endpoint", "ok", f"{store_client.endpoint() or 'Amazon'}, region {region}")
    given = [name for name in _CREDENTIALS.get(scheme, ()) if os.environ.get(name)]
    remedy = "" if given else f"set {_CREDENTIALS.get(scheme, ('its credentials',))[0]}, unless this machine has a role"
    yield Finding("store", "credentials", "ok" if given else "missing", ", ".join(given) or "not set", remedy)
    folder = cache.folder_of(url).parent
    yield Finding("store", "cache", "ok", f"{folder}, up to {cache.room() / 1e9:,.0f} GB ($SCENARIONET_CACHE_GB)")
    try:
        try:
            lake = Lake(url)
            yield Finding("lake", url, "ok", f"snapshot {lake.snapshot.number}, {len(lake):,} scenarios")
        except NoSuchSnapshot:
            yield Finding("lake", url, "missing", "not a lake yet", f"scenarionet convert DATASET RAW {url}")
        files, name = open_files(url), f".doctor/{uuid.uuid4().hex}"
        made = [files.publish_new(name, b"") for _ in range(2)]
        files.remove(name)
        if made == [True, False]:
            found = f"{url} is writable and refuses to overwrite objects on commit"
            yield Finding("lake", "writing", "ok", found)
        else:
            found = f"{url} overwrites an object that should have been refused"
            remedy = "commit from one client at a time, or use a store that supports If-None-Match: *"
            yield Finding("lake", "writing", "bad", found, remedy)
    except ScenarioNetError as error:
        yield Finding("store", url, "bad", str(error), "check the endpoint and the credentials above")
