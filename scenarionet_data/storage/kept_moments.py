"""Moments that are kept in a lake, outside snapshots: ``moments/<name>/<definition>/<version>/moments/<part>.parquet``.

A version is claimed by an immutable description, ``run.json``, with everything that its moments depend on. Each part
has at least one row for each scenario that was mined for it, with the hash of the scenario's content, so that the parts
say what is left to mine. Parts are numbered; of two jobs that publish the same number, one takes the next, without the
scenarios that the other has published.
"""

from __future__ import annotations

import re
import uuid
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import pyarrow as pa

from scenarionet_data.errors import BadParameter, LakeError
from scenarionet_data.schema import tables
from scenarionet_data.storage.files.lake_files import LakeFiles, Listed
from scenarionet_data.storage.integrity import seals
from scenarionet_data.storage.write.table_file import write_table

FOLDER = "moments"
_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9._-]*")
_KEYS = ["scenario_id", "content_hash"]


@dataclass
class KeptMoments:
    """One version of a definition of kept moments, which this process contributes to.

    Attributes:
        files: The lake.
        name: Name under which they are kept.
        definition: Name of the definition.
        version: From 1.
    """

    files: LakeFiles
    name: str
    definition: str
    version: int
    _read: dict[str, pa.Table] = field(default_factory=dict)

    @property
    def folder(self) -> str:
        """Folder in the lake."""
        return f"{FOLDER}/{self.name}/{self.definition}/{self.version}"

    def description(self) -> tuple[dict[str, Any], bool]:
        """Everything that the moments depend on, and whether it is sealed.

        Raises:
            LakeError: It is missing or damaged.
        """
        file = f"{self.folder}/run.json"
        try:
            return seals.read_json(self.files.content(file), self.files.place(file))
        except (ValueError, seals.NewerFormat) as error:
            remedy = f"remove {self.folder} and mine again"
            raise LakeError(f"{self.files.url(file)}: it describes no moments ({error}); {remedy}") from error

    def parts(self) -> list[str]:
        """Files with moments, in the order of their publication."""
        return [
            f"{self.folder}/moments/{number:06d}.parquet" for number in self.files.numbers(f"{self.folder}/moments")
        ]

    def mined(self) -> pa.Table:
        """The scenarios that were mined: scenario_id and content_hash."""
        for part in self.parts():
            if part not in self._read:
                self._read[part] = (
                    self.files.read(part, _KEYS).replace_schema_metadata(None).group_by(_KEYS).aggregate([])
                )
        empty = tables.load("moments").schema.remove_metadata().empty_table().select(_KEYS)
        return pa.concat_tables([empty, *self._read.values()])

    def publish(self, rows: pa.Table) -> int:
        """Publish rows of ``schemas/moments.toml`` of scenarios that nobody else has published; return their number."""
        while True:
            rows = rows.join(self.mined(), _KEYS, join_type="left anti").sort_by("scenario_id")
            if not rows.num_rows:
                return 0
            part = f"{self.folder}/moments/{1 + max([0, *self.files.numbers(f'{self.folder}/moments')]):06d}.parquet"
            written = write_table(self.files, FOLDER, rows.select(tables.load(FOLDER).schema.names), {})
            try:
                seals.seal(written, self.files.place_to_write(part))
                if self.files.publish_new(part, written):
                    return int(rows.num_rows - rows["first_timestep"].null_count)
            finally:
                written.unlink(missing_ok=True)


def claim(files: LakeFiles, name: str, definition: str, description: Mapping[str, Any]) -> KeptMoments:
    """Continue the newest version of a definition if it has the same digest, or begin a new one.

    Args:
        files: The lake.
        name: Name under which the moments are kept.
        definition: Name of the definition.
        description: JSON-serialisable; ``sha256`` is of everything that the moments depend on.

    Raises:
        BadParameter: A name has other characters than letters, digits, ".", "_" and "-".
    """
    for text in (name, definition):
        if not isinstance(text, str) or not _NAME.fullmatch(text):
            raise BadParameter(f"{text!r} is no name of moments; use letters, digits, '.', '_' and '-'")
    while True:
        newest = newest_version(files, name, definition)
        if newest and newest.description()[0].get("sha256") == description["sha256"]:
            return newest
        kept = KeptMoments(files, name, definition, newest.version + 1 if newest else 1)
        content = {**description, "tables": [tables.load(FOLDER).tag], "id": uuid.uuid4().hex}  # which seals cover
        file = f"{kept.folder}/run.json"
        if files.publish_new(file, seals.seal_json(content, files.place_to_write(file))):
            return kept


def versions(files: LakeFiles, name: str, definition: str) -> list[KeptMoments]:
    """All versions of a definition, ascending."""
    folder = f"{FOLDER}/{name}/{definition}"
    found = {each.name.removeprefix(f"{folder}/").partition("/")[0] for each in files.listing(folder)}
    return [KeptMoments(files, name, definition, number) for number in sorted(map(int, filter(str.isdecimal, found)))]


def newest_version(files: LakeFiles, name: str, definition: str) -> KeptMoments | None:
    """The newest version of a definition, if there is one."""
    found = versions(files, name, definition)
    return found[-1] if found else None


def drop(files: LakeFiles, name: str) -> None:
    """Remove all moments that are kept under a name.

    Raises:
        BadParameter: There are none; the message lists the names.
    """
    if name not in files.folders(FOLDER):
        have = ", ".join(files.folders(FOLDER)) or "none yet"
        raise BadParameter(f"{files.root}: no moments are kept under the name {name!r}; there are: {have}")
    files.remove(f"{FOLDER}/{name}")


def every(files: LakeFiles) -> list[list[KeptMoments]]:
    """All versions of each definition under each name."""
    return [
        versions(files, name, definition)
        for name in files.folders(FOLDER)
        for definition in files.folders(f"{FOLDER}/{name}")
    ]


def copy_newest(source: LakeFiles, target: LakeFiles, scenarios: pa.Table) -> list[str]:
    """Copy the moments of some scenarios, of the newest version of every definition, to a lake that has none.

    Args:
        source: The lake.
        target: The other lake.
        scenarios: scenario_id and content_hash.

    Returns:
        The files that were written.
    """
    written = []
    for kept in (listed[-1] for listed in every(source) if listed and listed[-1].parts()):
        parts = [source.read(part).replace_schema_metadata(None) for part in kept.parts()]
        rows = pa.concat_tables(parts).join(scenarios.select(_KEYS), _KEYS, join_type="left semi")
        if not rows.num_rows:
            continue
        copy = KeptMoments(target, kept.name, kept.definition, kept.version)
        file = f"{copy.folder}/run.json"
        target.publish_new(file, seals.seal_json(kept.description()[0], target.place_to_write(file)))
        copy.publish(rows)
        written += [file, *copy.parts()]
    return written


def part_files(files: LakeFiles) -> list[str]:
    """Files of the newest version of every definition."""
    return [part for listed in every(files) for kept in listed[-1:] for part in kept.parts()]


def superseded(files: LakeFiles) -> list[Listed]:
    """Files of versions that a newer one has replaced, which nobody reads."""
    return [each for listed in every(files) for kept in listed[:-1] for each in files.listing(kept.folder)]
