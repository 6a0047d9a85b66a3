"""Writers of formats, and the report of what a format cannot hold."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Protocol

from scenarionet_data.errors import InvalidScenario
from scenarionet_data.scenario.description import ScenarioDescription


@dataclass(frozen=True)
class Loss:
    """Something of a scenario that a file does not hold, or holds only approximately.

    Attributes:
        what: What it is, in the plural: ``"crosswalks"``.
        count: How many.
        error: Largest deviation of what was approximated; None for what was left out.
        unit: Unit of ``error``.
    """

    what: str
    count: int
    error: float | None = None
    unit: str = ""

    def __str__(self) -> str:
        if self.error is None:
            return f"{self.count:,} {self.what} left out"
        return f"{self.count:,} {self.what} approximated, to {self.error:.3g} {self.unit}".rstrip()


class Losses:
    """Collects the losses of one file, or of many.

    Example:
        >>> losses = Losses()
        >>> losses.leave_out("crosswalks", 2)
        >>> losses.approximate("lane centres", 10, 0.004, "m")
        >>> [str(loss) for loss in losses.found()]
        ['2 crosswalks left out', '10 lane centres approximated, to 0.004 m']
    """

    def __init__(self, losses: Iterable[Loss] = ()) -> None:
        self._found: dict[tuple[str, bool, str], tuple[int, float]] = {}
        for loss in losses:
            self._add(loss)

    def leave_out(self, what: str, count: int = 1) -> None:
        """Count what the file does not hold; nothing if ``count`` is 0."""
        self._add(Loss(what, count))

    def approximate(self, what: str, count: int, error: float, unit: str) -> None:
        """Count what the file holds with a deviation of at most ``error``; nothing if ``count`` is 0."""
        self._add(Loss(what, count, float(error), unit))

    def add(self, other: Iterable[Loss]) -> None:
        """Add the losses of another file."""
        for loss in other:
            self._add(loss)

    def found(self) -> tuple[Loss, ...]:
        """Return the losses in the order in which they were found, one for each kind."""
        return tuple(
            Loss(what, count, None if is_left_out else error, unit)
            for (what, is_left_out, unit), (count, error) in self._found.items()
        )

    def as_json(self) -> list[dict[str, Any]]:
        """Return the losses as JSON-able mappings."""
        return [asdict(loss) for loss in self.found()]

    def _add(self, loss: Loss) -> None:
        if loss.count:
            key = loss.what, loss.error is None, loss.unit
            count, error = self._found.get(key, (0, 0.0))
            self._found[key] = count + loss.count, max(error, loss.error or 0.0)


class FormatWriter(Protocol):
    """Writes scenarios in one format: a frozen dataclass whose fields are the format's options."""

    @property
    def name(self) -> str:
        """Name of the format."""
        ...

    def write(self, scenario: ScenarioDescription, stem: str, losses: Losses) -> Mapping[str, bytes]:
        """Return the files of one scenario by name; equal scenarios give equal bytes.

        Args:
            scenario: The scenario.
            stem: Name of its files without ending. A file that several scenarios share, such as a map, is named by
                what it holds: it is written once.
            losses: Collects what the files do not hold.

        Raises:
            InvalidScenario: The format cannot hold the scenario at all; the others are written.
        """
        ...


CameraFiles = Mapping[str, Sequence[bytes]]
"""JPEG files of a camera, one for each timestep, by name of the camera."""


@dataclass(frozen=True)
class ExportReport:
    """Result of an export.

    Attributes:
        directory: The folder or URL.
        num_scenarios, num_bytes: Written scenarios and their size, shared files counted once.
        refused: Scenarios that the format cannot represent, which are not written.
        num_files: Number of files; 0 for databases of pickles, which have one each.
        losses: What the files do not hold, in sum.
    """

    directory: Path | str
    num_scenarios: int
    num_bytes: int
    refused: tuple[InvalidScenario, ...]
    num_files: int = 0
    losses: tuple[Loss, ...] = ()
