"""Lineages that a pack keeps of the ancestors of its database, whose members it does not have."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from scenarionet_data.databases.record import Lineage
from scenarionet_data.storage.files.errors import damaged, reading, writing
from scenarionet_data.storage.files.lake_files import LakeFiles

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
        temporary.write_text(json.dumps(content, indent=1), "utf-8")
    return temporary


def read(files: LakeFiles) -> PackOrigins | None:
    """Read the origins of a pack; None for a lake that is not a pack."""
    if not files.has(FILE):
        return None
    path = files.path(FILE)
    try:
        with reading(path):
            content = json.loads(path.read_bytes())
        lineages = {reference: Lineage.from_dict(how) for reference, how in content["lineages"].items()}
        return PackOrigins(content["packed"], lineages)
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise damaged(path, "it holds no origins of a pack") from error
