"""Repeat requests to an object store until they succeed, for as long as the patience lasts.

The client library repeats most requests a few times. It gives up at once on others: conditional uploads whose
connection is reset, listings and deletions whose response is lost or cut off.
"""

from __future__ import annotations

import os
import random
import re
import time

_FIRST_WAIT = 0.1
_STATUS = re.compile(r"status(?: code:)? (\d{3}[^:]*)")
_TEMPORARY_STATUS = ("408", "429", "5")
_TEMPORARY_REASONS = ("RequestTimeout", "NoSuchUpload")
"""Errors with a permanent status that the next attempt does not meet: a stalled upload (400), and a multipart upload
that was completed, or removed, before its answer was lost (404)."""


class CutOff(Exception):
    """Fewer bytes arrived than the object store announced."""


class GaveUp(Exception):
    """A request failed for longer than the patience; the cause is its last error.

    Attributes:
        seconds: Time since the first attempt [s].
    """

    def __init__(self, seconds: float) -> None:
        super().__init__(seconds)
        self.seconds = seconds


class Attempts:
    """Attempts of one request, which starts now."""

    def __init__(self) -> None:
        self._started = time.monotonic()
        self._wait = _FIRST_WAIT

    def failed(self, error: Exception) -> None:
        """Wait after a failed attempt, with exponential backoff and jitter.

        Raises:
            Exception: ``error`` itself, if another attempt would fail, too.
            GaveUp: The patience has run out.
        """
        import obstore  # lazy: local lakes do not need it

        is_generic = type(error) is obstore.exceptions.GenericError
        is_temporary = isinstance(error, CutOff) or any(reason in str(error) for reason in _TEMPORARY_REASONS)
        if not (is_temporary or (is_generic and (status(error) or "5").startswith(_TEMPORARY_STATUS))):
            raise error
        waited = time.monotonic() - self._started
        if waited >= patience():
            raise GaveUp(waited) from error
        time.sleep(min(self._wait * random.uniform(0.5, 1.0), patience() - waited))  # noqa: S311  # jitter
        self._wait = min(2 * self._wait, longest_wait())


def patience() -> float:
    """Seconds for which failing requests are retried: ``$SCENARIONET_PATIENCE``."""
    return float(os.environ.get("SCENARIONET_PATIENCE") or 180)


def longest_wait() -> float:
    """Longest time between two attempts [s]."""
    return max(0.2, min(15.0, patience() / 4))


def status(error: BaseException) -> str | None:
    """Code and name of the HTTP status in an error; None if there was no whole response."""
    found = _STATUS.search(str(error))
    return found[1] if found else None
