"""Locate the folders ``schemas`` and ``sql``: next to the packages in a checkout, inside them in a wheel."""

from __future__ import annotations

from pathlib import Path

_HERE = Path(__file__).parents[1]
_ROOT = _HERE if (_HERE / "schemas").is_dir() else _HERE.parent

SCHEMAS = _ROOT / "schemas"
SQL = _ROOT / "sql"
