"""What a converter recognised among the raw files and did not take."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PassedOver:
    """Raw files, or parts of them, that a conversion does not use.

    Attributes:
        what: What they are, for example ``"files *.feather in sensors/lidar"``.
        count: Their number.
        reason: Why they are not used.
    """

    what: str
    count: int
    reason: str
