"""Where a database comes from: the tree of its parents, each with its lineage."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from scenarionet_data.databases import record as databases
from scenarionet_data.databases.record import Lineage
from scenarionet_data.errors import DatabaseNotFound
from scenarionet_data.packs import origins

if TYPE_CHECKING:
    from scenarionet_data.lake.lake import Lake


@dataclass(frozen=True)
class Ancestry:
    """A database in the tree.

    Attributes:
        reference: ``name@version``.
        versions: The versions there are, rising.
        lineage: How it was made; None when it is gone.
        is_here: Whether its members are here: not those of a packed database's ancestors.
        parents: What it was made from.
        children: ``name@version`` of what was made from this version.
    """

    reference: str
    versions: tuple[int, ...]
    lineage: Lineage | None
    is_here: bool
    parents: tuple[Ancestry, ...]
    children: tuple[str, ...]


def ancestry(lake: Lake, reference: str) -> Ancestry:
    """The tree of a database's parents.

    Args:
        lake: The lake.
        reference: ``name`` or ``name@version``.

    Raises:
        DatabaseNotFound: The message lists those that are there.
    """
    found = lake.database(reference)
    parents = tuple(_parent(lake, parent) for parent in found.lineage.parents)
    versions = tuple(databases.versions(lake.files, found.name))
    children = tuple(databases.children(lake.files, found.name, found.version))
    return Ancestry(found.reference, versions, found.lineage, True, parents, children)


def _parent(lake: Lake, reference: str) -> Ancestry:
    try:
        return ancestry(lake, reference)
    except DatabaseNotFound:
        name, _ = databases.parse_reference(reference)
        packed = origins.read(lake.files)
        lineage = packed.lineages.get(reference) if packed else None
        parents = tuple(_parent(lake, parent) for parent in lineage.parents) if lineage else ()
        return Ancestry(reference, tuple(databases.versions(lake.files, name)), lineage, False, parents, ())
