"""Properties of raw inputs known before conversion, and placeholders for files that stay in an object store."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

InputProperties = Mapping[str, str | tuple[str, ...]]
"""Location, log, date, ... of a raw input, to select recordings before converting; several values are a tuple."""

PLACEHOLDER = b"in an object store, not here: "
"""First bytes of the placeholder for a file in an object store, used while recordings are listed."""


def is_local(path: Path) -> bool:
    """Whether a file has its content, as opposed to a placeholder for a file in an object store."""
    try:
        with path.open("rb") as file:
            return file.read(len(PLACEHOLDER)) != PLACEHOLDER
    except OSError:  # reported when the file is read
        return True


@dataclass(frozen=True)
class LazyProperties(Mapping[str, str | tuple[str, ...]]):
    """Input properties; expensive ones are read from the file on first access.

    They are unknown while the file is a placeholder.

    Attributes:
        known: Properties known without reading the file.
        lazy: Keys of the others.
        find: Called with the path and such a key; picklable. Returns an empty tuple for what cannot be found.
        path: The file.
    """

    known: Mapping[str, str | tuple[str, ...]]
    lazy: tuple[str, ...]
    find: Callable[[Path, str], str | tuple[str, ...]]
    path: Path

    def __getitem__(self, key: str) -> str | tuple[str, ...]:
        if key in self.lazy and is_local(self.path):
            return self.find(self.path, key)
        return self.known[key]

    def __iter__(self) -> Iterator[str]:
        return iter((*self.known, *(self.lazy if is_local(self.path) else ())))

    def __len__(self) -> int:
        return len(list(iter(self)))
