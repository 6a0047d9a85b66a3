"""JSON text for the `extras` columns, the same bytes for the same content."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

# Skipping the check for circular references takes a quarter of the time; a cycle raises RecursionError.
_ENCODER = json.JSONEncoder(
    sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False, check_circular=False
)


def to_json(extras: Mapping[str, Any] | None) -> str | None:
    """Return JSON text with sorted keys, or None for an empty mapping.

    Example:
        >>> to_json({"b": 1, "a": [2.5]})
        '{"a":[2.5],"b":1}'
    """
    if not extras:
        return None
    return _ENCODER.encode(extras)


def from_json(text: str | None) -> dict[str, Any]:
    """Return the mapping that :func:`to_json` encoded; empty for None."""
    return json.loads(text) if text else {}
