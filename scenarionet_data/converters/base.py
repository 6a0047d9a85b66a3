"""The seam every dataset plugs into: a converter lists shards cheaply and turns raw records into scenarios.

A converter sees raw files, ``scenario``, ``building``, ``vocabulary``, ``geometry`` and ``errors``. It never
builds tables, opens the lake, or knows its paths.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar

from scenarionet_data.converters.splits import is_of_split
from scenarionet_data.errors import SourceNotFound
from scenarionet_data.ingest.options import Options
from scenarionet_data.ingest.shard import Shard
from scenarionet_data.scenario.description import ScenarioDescription

if TYPE_CHECKING:
    from scenarionet_data.building import MapBuilder


@dataclass(frozen=True)
class Budgets:
    """How far recorded motion may stray from plausible motion: the numbers in the soft rules of ``sql/checks``.

    A scenario is judged by its moving objects, without the first and last step of each run of timesteps and without
    reversing: it strays when half of what is measured is beyond a median, or 1 of 100 beyond a 99th percentile.

    Attributes:
        velocity_median, velocity_p99: |velocity - change of position / time| [m/s].
        heading_p99: |angle between velocity and heading| [rad] above 1 m/s.
        step_speed: Distance over time between two timesteps [m/s]; what is faster has jumped.
        link_gap: Distance from a lane's end to its successor's start [m].
        outliers: Share of a dataset's scenarios that may stray.
    """

    velocity_median: float = 0.5
    velocity_p99: float = 5.0
    heading_p99: float = 1.0
    step_speed: float = 60.0
    link_gap: float = 5.0
    outliers: float = 0.01


Record = TypeVar("Record")


class Converter(ABC, Generic[Record]):
    """Turns one dataset's raw recordings into scenarios.

    Class attributes:
        name: The dataset's name on the command line and in the lake.
        version: The converter's own version; raise it when its output changes.
        release: Default of the dataset's version.
        licence: Licence of the recordings.
        raw: What RAW has to be, in one line.
        Options: Dataclass of what the converter can be told.
        properties: Keys of what is known of its recordings before they are read, beyond ``file`` and ``name``.
        budgets: How far real recordings stray from plausible motion.
        listed: Of RAW in an object store, the files whose content ``shards`` and ``maps`` read: glob patterns for the
            end of a path, for example ``"scenes/*.json"``. Of all others they find names and sizes there.
        ignored: Names of folders that hold nothing a converter reads, for example images by the million.
    """

    name: ClassVar[str]
    version: ClassVar[str]
    release: ClassVar[str]
    licence: ClassVar[str]
    raw: ClassVar[str]
    Options: ClassVar[type[Options]] = Options
    properties: ClassVar[tuple[str, ...]] = ()
    budgets: ClassVar[Budgets] = Budgets()
    listed: ClassVar[tuple[str, ...]] = ()
    ignored: ClassVar[Collection[str]] = frozenset()

    @abstractmethod
    def shards(self, raw: str, split: str, version: str, options: Any) -> Iterable[Shard]:
        """List the units of work under ``raw`` without reading their content.

        Raises:
            SourceNotFound: Nothing of this dataset is there; the message says what was looked for.
        """

    @abstractmethod
    def records(self, shard: Shard) -> Iterator[Record]:
        """Read a shard's raw records one by one, on a worker, in bounded memory.

        Raises:
            CorruptSource: The shard cannot be read to its end; it fails as a whole.
        """

    @abstractmethod
    def scenario(self, shard: Shard, record: Record) -> ScenarioDescription:
        """Make one record a scenario.

        Raises:
            InvalidScenario: This record is unusable and goes to quarantine; the shard goes on. So does any
                other exception raised here.
        """

    def dataset_folder(self, raw: Path) -> Path:
        """The folder below which all lies that ``raw`` needs: itself, or a folder above when ``raw`` is a part."""
        return raw

    def files(self, shard: Shard) -> Iterator[Iterable[str]]:
        """What reading a shard takes of an object store, for a worker to download; its items unless told otherwise.

        Names lie below the shard's root, and the last part of one may be a pattern: ``map/*.json``. They come in
        batches: each is on this machine, below ``shard.root``, when the next one is asked for, so that one may look
        into what is there. What the store does not have is not there, as in a folder.
        """
        yield [item.name for item in shard.items]

    def maps(self, raw: str, version: str, options: Any) -> Iterable[Shard]:  # noqa: ARG002
        """List the maps that many scenarios share, for example a city's; most datasets have none.

        Each is a shard with an empty split whose name is the ``map_id`` that scenarios refer to. They are
        committed before any scenario.
        """
        return ()

    def map_features(self, shard: Shard) -> MapBuilder:
        """Read a shared map, on a worker.

        Raises:
            CorruptSource: It cannot be read.
        """
        raise NotImplementedError(f"{self.name} has no shared maps, so none is called {shard.name}")


def find_files(raw: str, pattern: str, what: str, split: str | None = None) -> list[Path]:
    """Files below ``raw`` that match a glob pattern, sorted; ``raw`` may be such a file itself.

    Args:
        raw: Folder or file.
        pattern: Glob, for example ``"*.tfrecord*"``.
        what: What the user should have there, for the message.
        split: Leave out what lies in folders named after another split.

    Raises:
        SourceNotFound: There is no such folder, or nothing in it matches.
    """
    root = Path(raw)
    if root.is_file() and root.match(pattern):
        return [root]
    if not root.is_dir():
        raise SourceNotFound(f"{raw}: no such folder; give the folder with {what}")
    found = [path for path in root.rglob(pattern) if path.is_file() and (not split or is_of_split(path, root, split))]
    if not found:
        of_split = f" of split {split}" if split else ""
        raise SourceNotFound(f"{raw}: nothing named {pattern}{of_split} in it; give the folder with {what}")
    return sorted(found)
