"""The part of the handle ``Lake`` that compares databases and finds events."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from scenarionet_data.databases.record import DatabaseRecord
from scenarionet_data.operations.comparison import DatabaseStatistics, compare
from scenarionet_data.operations.diff import Diff, diff
from scenarionet_data.operations.events import mine
from scenarionet_data.operations.overlap import DatabaseOverlap, overlap
from scenarionet_data.query.lake_view import LakeView

if TYPE_CHECKING:
    import polars as pl


class ComparableLake(LakeView):
    """A view of a lake with comparisons and events; a base class of :class:`~scenarionet_data.Lake`."""

    def compare(self, *databases: DatabaseRecord | str) -> list[DatabaseStatistics]:
        """Return statistics of databases in the given order; of the whole lake without any."""
        return compare(self, *databases)

    def diff(self, before: DatabaseRecord | str, after: DatabaseRecord | str) -> Diff:
        """Compare two sets of scenarios: members that came, went or changed, and columns with other values.

        Args:
            before, after: Databases, ``name``, ``name@version``, or ``@7`` for the whole lake at snapshot 7.
        """
        return diff(self, before, after)

    def overlap(self, *databases: DatabaseRecord | str, kinds: Sequence[str] | None = None) -> list[DatabaseOverlap]:
        """Find what two or more databases share, pair by pair: scenarios, contents, logs, seconds of a log, drives.

        Args:
            *databases: The databases; this snapshot describes their members.
            kinds: Rules of ``sql/overlaps``, all by default. Only ``near_duplicate`` reads tracks.

        Returns:
            One result per pair and rule, including empty ones.

        Raises:
            UnknownQuery: No such rule.
        """
        return overlap(self, *databases, kinds=kinds)

    def mine(
        self,
        event: str,
        parameters: Mapping[str, Any] | None = None,
        database: DatabaseRecord | str | None = None,
    ) -> pl.DataFrame:
        """Find all occurrences of an event, in order of scenario and time.

        Args:
            event: Name of an event of ``sql/events``.
            parameters: Values of its parameters as Python values; the others keep their defaults.
            database: Search only its members.

        Raises:
            UnknownEvent: No such event.
            BadParameter: No such parameter, or a value of another type.
        """
        return mine(self, event, parameters, database)
