"""The result of one check of ``scenarionet maintain doctor``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Finding:
    """The result of one check.

    Attributes:
        topic: Area of the check, for example ``"packages"``.
        subject: What was checked, for example the name of a package.
        state: ``ok``, ``missing`` for something optional, or ``bad`` for a problem to fix.
        found: What was found.
        remedy: What to do; empty if there is nothing to do.
    """

    topic: str
    subject: str
    state: Literal["ok", "missing", "bad"]
    found: str
    remedy: str = ""
