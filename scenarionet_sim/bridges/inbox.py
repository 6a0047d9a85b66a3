"""What a driving stack sent and nobody read yet, and the wire it came over."""

from __future__ import annotations

import threading
import time
from collections import deque
from typing import Protocol

ROOM = 256
"""Messages that are kept; a stack that floods loses its oldest ones."""


class Inbox:
    """Messages that threads of a wire put and the simulation takes, oldest first."""

    def __init__(self) -> None:
        self._messages: deque[tuple[str, bytes]] = deque(maxlen=ROOM)
        self._has_changed = threading.Condition()

    def put(self, topic: str, content: bytes) -> None:
        """Add a message; the oldest one gives way where there are too many."""
        with self._has_changed:
            self._messages.append((topic, content))
            self._has_changed.notify()

    def take(self, until: float) -> tuple[str, bytes] | None:
        """Return topic and content of the oldest message, None if none comes before ``until`` [s, monotonic]."""
        with self._has_changed:
            self._has_changed.wait_for(lambda: self._messages, max(until - time.monotonic(), 0.0))
            return self._messages.popleft() if self._messages else None


class Wire(Protocol):
    """Carries serialised messages between processes."""

    def publish(self, topic: str, content: bytes) -> None:
        """Send a message on one of the topics that the wire was opened with."""
        ...

    def close(self) -> None:
        """Let go of ports and threads."""
        ...
