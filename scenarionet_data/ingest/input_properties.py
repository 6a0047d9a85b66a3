"""What is known of raw recordings before they are converted, and whether a file's content is there to be asked."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

Facts = Mapping[str, str | tuple[str, ...]]
"""What is known before converting, to choose recordings by: location, log, date, ...; several values are a tuple."""

PLACEHOLDER = b"in an object store, not here: "
"""How a file begins that stands for one in an object store while recordings are listed."""


def is_at_hand(path: Path) -> bool:
    """Whether a file is itself, and no placeholder for one in an object store."""
    try:
        with path.open("rb") as file:
            return file.read(len(PLACEHOLDER)) != PLACEHOLDER
    except OSError:  # whoever reads it says what is wrong
        return True


@dataclass(frozen=True)
class FactsOnDemand(Mapping[str, str | tuple[str, ...]]):
    """Facts of which some take a look into a file, which is taken when somebody chooses by them.

    Where the file is not at hand, these are not known.

    Attributes:
        told: What is known already.
        asked: Keys of the rest.
        find: Called with the path and such a key; picklable. Returns no value, ``()``, for what cannot be found.
        path: Of the file.
    """

    told: Mapping[str, str | tuple[str, ...]]
    asked: tuple[str, ...]
    find: Callable[[Path, str], str | tuple[str, ...]]
    path: Path

    def __getitem__(self, key: str) -> str | tuple[str, ...]:
        if key in self.asked and is_at_hand(self.path):
            return self.find(self.path, key)
        return self.told[key]

    def __iter__(self) -> Iterator[str]:
        return iter((*self.told, *(self.asked if is_at_hand(self.path) else ())))

    def __len__(self) -> int:
        return len(list(iter(self)))
