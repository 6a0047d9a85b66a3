"""An object store behind obstore: opened by URL, patient with errors, its refusals in our words.

Credentials, region and endpoint come from the environment that every tool for object stores knows
(``AWS_ACCESS_KEY_ID``, ``AWS_ENDPOINT_URL``, ``GOOGLE_APPLICATION_CREDENTIALS``, ...).
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import timedelta
from pathlib import Path
from typing import Any

from scenarionet_data.errors import LakeError, MissingDependency
from scenarionet_data.software import PACKAGE

SCHEMES = ("s3", "gs")
_ENDPOINTS = ("AWS_ENDPOINT_URL_S3", "AWS_ENDPOINT_URL", "AWS_ENDPOINT")

_first_used_by: int | None = None


def open_store(url: str) -> Any:
    """The obstore store of everything below a URL.

    Raises:
        LakeError: The URL is of a kind that is not known, or what the environment says cannot be.
        MissingDependency: obstore is not installed.
    """
    try:
        import obstore.exceptions
        import obstore.store
    except ImportError as error:
        raise MissingDependency(f"{url} needs obstore; pip install '{PACKAGE}[remote]'") from error
    scheme, _, place = url.partition("://")
    if scheme not in SCHEMES or not place.strip("/"):
        raise LakeError(f"{url}: wanted a folder, s3://BUCKET/PREFIX, gs://BUCKET/PREFIX or file:///FOLDER")
    _refuse_after_fork(url)
    try:
        return obstore.store.from_url(url, **options(scheme))
    except (obstore.exceptions.BaseError, ValueError) as error:
        raise LakeError(f"{url}: {_first_line(error)}; `scenarionet doctor {url}` says what is set") from error


def options(scheme: str) -> dict[str, Any]:
    """What stores are opened with besides what the environment says."""
    chosen: dict[str, Any] = {
        "client_options": {"allow_http": (endpoint() or "").startswith("http://"), "timeout": "60s"},
        "retry_config": {
            "max_retries": 20,
            "retry_timeout": timedelta(seconds=patience()),
            "backoff": {
                "init_backoff": timedelta(seconds=0.1),
                "max_backoff": timedelta(seconds=max(0.2, min(15.0, patience() / 4))),
                "base": 2,
            },
        },
    }
    if scheme == "s3" and endpoint():
        chosen["config"] = {"endpoint": endpoint()}
    return chosen


def endpoint() -> str | None:
    """The S3 server that is not Amazon's, if one is set."""
    return next((os.environ[name] for name in _ENDPOINTS if os.environ.get(name)), None)


def patience() -> float:
    """Seconds for which a request is tried again when the store answers with errors: ``$SCENARIONET_PATIENCE``."""
    return float(os.environ.get("SCENARIONET_PATIENCE") or 180)


@contextmanager
def asking(url: str) -> Iterator[None]:
    """Turns what an object store refuses into a LakeError with the remedy.

    That a file is not there, or there already, passes: whoever asks knows what it means.

    Args:
        url: What the message names.
    """
    from obstore import exceptions

    try:
        yield
    except exceptions.AlreadyExistsError:
        raise
    except (exceptions.PermissionDeniedError, exceptions.UnauthenticatedError) as error:
        raise LakeError(
            f"{url}: refused; set credentials that may read and write there (AWS_ACCESS_KEY_ID and the like), "
            f"`scenarionet doctor {url}` says what is set"
        ) from error
    except exceptions.BaseError as error:
        answer = re.search(r"status code: ([^:]*)", str(error))
        if answer and answer.group(1).startswith("404"):
            raise no_bucket(url) from error
        raise LakeError(
            f"{url}: the object store answers {answer.group(1) if answer else _first_line(error)}; asked for up to "
            f"{patience():.0f} s ($SCENARIONET_PATIENCE). What is committed is kept: run the same command again when "
            "the store is well"
        ) from error


def save(got: Any, path: Path) -> None:
    """Write what obstore got to a file, piece by piece."""
    with path.open("wb") as file:
        for piece in got.stream():
            file.write(piece)


def no_bucket(url: str) -> LakeError:
    """What to do when there is no such bucket."""
    return LakeError(f"{url}: no such bucket; make it first, or check the name and `scenarionet doctor {url}`")


def _first_line(error: Exception) -> str:
    """The first line of a message, which goes on with what happened inside the library."""
    return str(error).partition("\n")[0]


def _refuse_after_fork(url: str) -> None:
    """A forked child has the locks of the parent's network threads without the threads: it would wait for ever."""
    global _first_used_by
    _first_used_by = _first_used_by or os.getpid()
    if _first_used_by != os.getpid():
        raise LakeError(
            f"{url}: this process was forked from one that talks to an object store; start workers by spawn "
            "(for torch: DataLoader(..., multiprocessing_context='spawn'))"
        )
