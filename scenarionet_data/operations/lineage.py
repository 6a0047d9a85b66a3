"""Lineage trees: a database, its parents, and how each was made."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from scenarionet_data.databases import pack_origins
from scenarionet_data.databases import record as records
from scenarionet_data.databases.record import DatabaseRecord, Lineage
from scenarionet_data.errors import DatabaseNotFound
from scenarionet_data.query.lake_view import LakeView


@dataclass(frozen=True)
class LineageTree:
    """A database and its ancestors.

    Attributes:
        reference: ``name@version``.
        versions: Existing versions in ascending order.
        lineage: How it was made; None if it is unknown.
        is_here: Whether the lake has its members; a pack lacks those of ancestors.
        parents: Databases it was made from.
        children: ``name@version`` of the databases made from this version.
    """

    reference: str
    versions: tuple[int, ...]
    lineage: Lineage | None
    is_here: bool
    parents: tuple[LineageTree, ...]
    children: tuple[str, ...]

    def ancestors(self) -> Iterator[LineageTree]:
        """Yield all databases above this one, depth first."""
        for parent in self.parents:
            yield parent
            yield from parent.ancestors()


def lineage_tree(view: LakeView, database: DatabaseRecord | str) -> LineageTree:
    """Return a database with its ancestors; see :meth:`Lake.lineage <scenarionet_data.Lake.lineage>`."""
    found = view.record(database)
    parents = tuple(_parent(view, parent) for parent in found.lineage.parents)
    if found.name is None:
        return LineageTree(found.reference, (), found.lineage, True, parents, ())
    versions = tuple(records.versions(view.files, found.name))
    children = tuple(records.children(view.files, found.name, found.version))
    return LineageTree(found.reference, versions, found.lineage, True, parents, children)


def _parent(view: LakeView, reference: str) -> LineageTree:
    try:
        return lineage_tree(view, reference)
    except DatabaseNotFound:
        name, _ = records.parse_reference(reference)
        origins = pack_origins.read(view.files)
        lineage = origins.lineages.get(reference) if origins else None
        parents = tuple(_parent(view, parent) for parent in lineage.parents) if lineage else ()
        return LineageTree(reference, tuple(records.versions(view.files, name)), lineage, False, parents, ())
