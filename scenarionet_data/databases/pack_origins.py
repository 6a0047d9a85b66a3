"""Lineages that a pack keeps of the ancestors of its database, whose members it does not have."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from scenarionet_data.databases.record import Lineage
from scenarionet_data.errors import LakeError
from scenarionet_data.storage.files.errors import writing
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.integrity import seals
from scenarionet_data.storage.integrity.seals import NewerFormat

FILE = "origins.json"


@dataclass(frozen=True)
class PackOrigins:
    """Lineages from the lake that a pack was made from.

    Attributes:
        packed: ``name@version`` of the database.
        lineages: Lineages of its ancestors, by ``name@version``.
    """

    packed: str
    lineages: dict[str, Lineage]


def write(files: LakeFiles, packed: str, lineages: Mapping[str, Lineage]) -> Path:
    """Write a temporary file with the lineages of a database's ancestors."""
    content = {"packed": packed, "lineages": {reference: how.to_dict() for reference, how in lineages.items()}}
    temporary = files.temporary()
    with writing(temporary, temporary):
        temporary.write_bytes(seals.seal_json(content, files.place_to_write(FILE)))
    return temporary


def read(files: LakeFiles) -> PackOrigins | None:
    """Read the origins of a pack; None for a lake that is not a pack."""
    return parse(files)[0] if files.has(FILE) else None


def parse(files: LakeFiles) -> tuple[PackOrigins, bool]:
    """The origins of a pack, and whether they are sealed, and therefore verified.

    Raises:
        LakeError: They are damaged, or were written by a newer version of this software.
    """
    path = files.path(FILE)
    try:
        content, is_sealed = seals.read_json(files.content(FILE), files.place(FILE))
        lineages = {reference: Lineage.from_dict(how) for reference, how in content["lineages"].items()}
        return PackOrigins(content["packed"], lineages), is_sealed
    except NewerFormat as error:
        raise LakeError(f"{path}: {error}, by a newer version of this software; update it") from error
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise LakeError(
            f"{path}: damaged, it holds no lineages ({error}); restore it from a copy of the pack"
        ) from error
