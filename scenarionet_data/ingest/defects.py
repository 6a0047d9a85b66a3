"""Collect what a conversion drops from a recording, or completes by an assumption."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from numbers import Integral

from scenarionet_data.scenario.defects import Defect

__all__ = ["Defect", "Defects", "merge_defects"]

_NAMED = 3
"""Rows or features that a defect names."""


class Defects:
    """Collects the defects of one scenario or shared map, in bounded memory.

    Rows or features with the same table, file, field, action and kind of reason become one :class:`Defect`, which
    names the first three of them. The kind of a reason is its text up to ``", found "``.

    Example:
        >>> defects = Defects()
        >>> defects.drop("tracks", "a.feather", [15, 4001], "size", "expected a length above 0 m, found 0.0")
        >>> defects.found()[0].location, defects.found()[0].count
        ('rows 15, 4,001', 2)
    """

    def __init__(self) -> None:
        self._groups: dict[tuple[str, ...], _Group] = {}

    def drop(self, table: str, file: str, locations: Sequence[object], field: str, reason: str) -> None:
        """Count rows or features that are left out.

        Args:
            table: ``"tracks"``, ``"lights"`` or ``"maps"``.
            file: Raw file, relative to the raw folder.
            locations: A row number (int), token or id for each; none if nothing is left out.
            field: The field at fault.
            reason: ``"expected ..., found ..."``, with what was found first.
        """
        self._add(table, file, locations, field, "dropped", reason)

    def assume(self, table: str, file: str, locations: Sequence[object], field: str, reason: str) -> None:
        """Count rows or features that are kept with an assumed value; arguments as for :meth:`drop`."""
        self._add(table, file, locations, field, "assumed", reason)

    def assume_empty_map(self, file: str) -> None:
        """Say that a scenario that should have a map has no features in it."""
        self.assume("maps", file, ["the whole map"], "features", "expected a map around the ego's path, found none")

    def found(self) -> tuple[Defect, ...]:
        """Return the defects in the order in which they were found."""
        return tuple(
            Defect(table, file, group.location, name, action, group.reason, group.count)
            for (table, file, name, action, _), group in self._groups.items()
        )

    def _add(self, table: str, file: str, locations: Sequence[object], name: str, action: str, reason: str) -> None:
        if len(locations):
            group = self._groups.setdefault((table, file, name, action, _kind(reason)), _Group(reason))
            group.count += len(locations)
            group.named += list(locations[: _NAMED - len(group.named)])


@dataclass
class _Group:
    """Defects of one kind: the reason as found first, the number, and the first locations."""

    reason: str
    count: int = 0
    named: list[object] = field(default_factory=list)

    @property
    def location(self) -> str:
        """The named rows, tokens or ids as text."""
        are_rows = all(isinstance(each, Integral) for each in self.named)
        words = [f"{each:,}" if are_rows else str(each) for each in self.named]
        label = ("row " if self.count == 1 else "rows ") if are_rows else ""
        return label + ", ".join(words) + (", ..." if self.count > len(words) else "")


def merge_defects(defects: Iterable[Defect]) -> tuple[Defect, ...]:
    """Return defects as they are, but those of one kind (see :class:`Defects`) as one, with the sum of their counts."""
    merged: dict[tuple[str, ...], Defect] = {}
    for each in defects:
        key = (each.table, each.file, each.field, each.action, _kind(each.reason))
        known = merged.get(key)
        merged[key] = each if known is None else replace(known, count=known.count + each.count)
    return tuple(merged.values())


def _kind(reason: str) -> str:
    return reason.partition(", found ")[0]
