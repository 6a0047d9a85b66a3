"""What a conversion dropped from a recording, or completed by an assumption."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Defect:
    """Rows or features of a recording that were dropped, or completed by an assumption.

    Attributes:
        table: Table that they would have become part of: ``"tracks"``, ``"lights"`` or ``"maps"``.
        file: Raw file, relative to the raw folder.
        location: The first few rows, tokens or ids, for example ``"rows 15, 812, 4,001, ..."``.
        field: The field at fault, for example ``"extent"``.
        action: ``"dropped"`` or ``"assumed"``.
        reason: What was expected and found, for example ``"expected a length above 0 m, found 0.0"``.
        count: Number of rows or features.
    """

    table: str
    file: str
    location: str
    field: str
    action: str
    reason: str
    count: int
