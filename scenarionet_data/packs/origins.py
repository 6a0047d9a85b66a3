"""Where a packed database came from: the lineages of its ancestors, whose members stay behind."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from scenarionet_data.databases.record import Lineage
from scenarionet_data.storage.files.errors import reading, writing
from scenarionet_data.storage.files.lake_files import LakeFiles

if TYPE_CHECKING:
    from scenarionet_data.operations.lineage import Ancestry

FILE = "origins.json"


@dataclass(frozen=True)
class Origins:
    """What a pack knows of the lake it was packed from.

    Attributes:
        packed: ``name@version`` of the database.
        lineages: How its ancestors were made, by ``name@version``.
    """

    packed: str
    lineages: dict[str, Lineage]


def write(files: LakeFiles, tree: Ancestry) -> Path:
    """A temporary file with the ancestors of a database."""
    lineages = {reference: asdict(lineage) for reference, lineage in _ancestors(tree)}
    temporary = files.temporary()
    with writing(temporary, temporary):
        temporary.write_text(json.dumps({"packed": tree.reference, "lineages": lineages}, indent=1), "utf-8")
    return temporary


def read(files: LakeFiles) -> Origins | None:
    """What a pack knows; None for a lake that is no pack."""
    if not files.has(FILE):
        return None
    with reading(files.path(FILE)):
        told = json.loads(files.path(FILE).read_text("utf-8"))
    return Origins(told["packed"], {reference: Lineage(**how) for reference, how in told["lineages"].items()})


def _ancestors(tree: Ancestry) -> Iterator[tuple[str, Lineage]]:
    for parent in tree.parents:
        if parent.lineage is not None:
            yield parent.reference, parent.lineage
        yield from _ancestors(parent)
