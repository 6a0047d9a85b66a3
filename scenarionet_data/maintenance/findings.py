"""What a check of a lake has found so far."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.integrity.file_checks import Damage, finding


@dataclass
class Findings:
    """Damages, and files that cannot be verified completely.

    Attributes:
        damages: Damaged files, with reasons.
        older: Files of older versions, which have no seal of the present one.
    """

    damages: list[Damage] = field(default_factory=list)
    older: set[str] = field(default_factory=set)

    @property
    def broken(self) -> set[str]:
        """Names of the damaged files."""
        return {damage.file for damage in self.damages}

    @contextmanager
    def of(self, name: str) -> Iterator[None]:
        """Add any error as damage of a file."""
        with finding(name, self.damages):
            yield

    def saw(self, name: str, *, is_older: bool) -> None:
        """Note whether a file is of an older version."""
        if is_older:
            self.older.add(name)

    def refuse_folders(self, files: LakeFiles, place: str) -> None:
        """Add every folder in a folder that holds only files."""
        self.damages += (Damage(f"{place}/{name}", "a folder, expected a file") for name in files.folders(place))
