"""Settings of an object store's client: from the usual environment variables, with retries."""

from __future__ import annotations

import os
from datetime import timedelta
from typing import Any

from scenarionet_data.errors import LakeError, needing
from scenarionet_data.storage.files.retries import longest_wait, patience

_SCHEMES = ("s3", "gs")
_ENDPOINTS = ("AWS_ENDPOINT_URL_S3", "AWS_ENDPOINT_URL", "AWS_ENDPOINT")
_QUICK_RETRIES = 3
"""Attempts that the client library repeats by itself, for example of one part of a large upload."""

_first_used_by: int | None = None


def connect(url: str) -> Any:
    """An obstore client of everything below a URL; see :class:`.object_store.ObjectStore` for what it raises."""
    with needing(f"{url} needs obstore", "remote"):
        import obstore
    scheme, _, place = url.partition("://")
    if scheme not in _SCHEMES or not place.strip("/"):
        raise LakeError(f"{url}: wanted a folder, s3://BUCKET/PREFIX, gs://BUCKET/PREFIX or file:///FOLDER")
    global _first_used_by
    _first_used_by = _first_used_by or os.getpid()
    if _first_used_by != os.getpid():  # it inherits locks of network threads, but not the threads, and would hang
        raise LakeError(
            f"{url}: this process was forked from one that uses an object store; start workers by spawn "
            "(for torch: DataLoader(..., multiprocessing_context='spawn'))"
        )
    backoff = {"init_backoff": timedelta(seconds=0.1), "max_backoff": timedelta(seconds=longest_wait()), "base": 2}
    retries = {"max_retries": _QUICK_RETRIES, "retry_timeout": timedelta(seconds=patience()), "backoff": backoff}
    client = {"allow_http": (endpoint() or "").startswith("http://"), "timeout": "60s"}
    options: dict[str, Any] = {"client_options": client, "retry_config": retries}
    if scheme == "s3" and endpoint():
        options["config"] = {"endpoint": endpoint()}
    try:
        return obstore.store.from_url(url, **options)  # type: ignore[call-overload,misc,unused-ignore]
    except (obstore.exceptions.BaseError, ValueError) as error:
        raise LakeError(
            f"{url}: {first_line(error)}; `scenarionet maintain doctor {url}` lists the settings"
        ) from error


def endpoint() -> str | None:
    """URL of an S3-compatible server other than Amazon's, if one is set."""
    return next((os.environ[name] for name in _ENDPOINTS if os.environ.get(name)), None)


def first_line(error: BaseException | None) -> str:
    """The first line of a message; the following ones describe library internals."""
    return str(error).partition("\n")[0]
