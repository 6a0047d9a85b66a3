"""Base class of converters: list the shards of a dataset cheaply, and turn raw records into scenarios.

Converters use raw files, ``scenario``, ``building``, ``arrays``, ``ingest`` and ``errors``. They do not build tables
or access a lake.
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar

from scenarionet_data.converters.splits import is_of_split, splits_of
from scenarionet_data.errors import SourceNotFound
from scenarionet_data.ingest.listing import walk
from scenarionet_data.ingest.options import Options
from scenarionet_data.ingest.passed_over import PassedOver
from scenarionet_data.ingest.shard import Shard
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.scenario.settings import check_settings

if TYPE_CHECKING:
    from scenarionet_data.building import MapBuilder

_RAYLEIGH_75, _RAYLEIGH_995, _NORMAL_995 = 1.665, 3.255, 2.576
"""Quantiles of the length of a normal vector in the plane (75 %, 99.5 %), and of a normal number (99 % both sides)."""


@dataclass(frozen=True)
class Budgets:
    """Tolerances for implausible motion: the thresholds of the soft rules in ``sql/checks``.

    A scenario is measured on its moving objects, excluding the first and last step of each valid run and reversing
    vehicles. It is an outlier if its median or its 99th percentile exceeds the threshold.

    Attributes:
        velocity_median, velocity_p99: |velocity - change of position / time| [m/s].
        heading_p99: |angle between velocity and heading| [rad] above 1 m/s.
        step_speed: Distance over time between two timesteps [m/s]; faster objects have jumped.
        link_gap: Distance from a lane's end to its successor's start [m].
        outliers: Permitted fraction of outliers among a dataset's scenarios.
    """

    velocity_median: float = 0.5
    velocity_p99: float = 5.0
    heading_p99: float = 1.0
    step_speed: float = 60.0
    link_gap: float = 5.0
    outliers: float = 0.01

    def __post_init__(self) -> None:
        check_settings(self)

    @classmethod
    def from_noise(
        cls, usual: float, rare: float, *, velocity: float = 0.0, dt: float = 0.1, outliers: float = 0.01
    ) -> Budgets:
        """Derive the budgets for motion from the noise of a sensor, see ``docs/guides/checks.md``.

        The defaults of the class are those of ``usual=0.025, rare=0.25``.

        Args:
            usual, rare: Distances from the true position that 75 % and 99.5 % of the recorded ones do not exceed [m].
            velocity: Standard deviation of each component of the velocities [m/s].
            dt: Timestep [s].
            outliers: As in the class.
        """
        return cls(
            velocity_median=round(2.0 * usual / dt + _RAYLEIGH_75 * velocity, 2),
            velocity_p99=round(2.0 * rare / dt + _RAYLEIGH_995 * velocity, 2),
            heading_p99=round(_NORMAL_995 * velocity, 2) if velocity else cls.heading_p99,
            step_speed=round(cls.step_speed + 2.0 * rare / dt, 1),
            outliers=outliers,
        )


Record = TypeVar("Record")


class Converter(ABC, Generic[Record]):
    """Converts the raw recordings of one dataset into scenarios.

    Class attributes:
        name: The dataset's name on the command line and in the lake.
        version: The converter's version; increment it when its output changes.
        release: Default version of the dataset.
        licence: Licence of the recordings.
        raw: Description of RAW, in one line.
        Options: Dataclass of the converter's options.
        properties: Keys of the input properties it lists, in addition to ``file`` and ``name``.
        budgets: Tolerances for implausible motion in its recordings.
        listed: Glob patterns (matched at the end of a path, for example ``"scenes/*.json"``) of the files whose content
            ``shards`` and ``maps`` read. In an object store only these are downloaded for listing.
        ignored: Names of folders that the converter does not read, for example images.
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
        """List the shards under ``raw`` without reading their content.

        Raises:
            SourceNotFound: No recordings of this dataset; the message states the expected files.
        """

    @abstractmethod
    def records(self, shard: Shard) -> Iterator[Record]:
        """Read a shard's raw records one by one, on a worker, in bounded memory.

        Raises:
            CorruptSource: The shard cannot be read to its end; the whole shard fails.
        """

    @abstractmethod
    def scenario(self, shard: Shard, record: Record) -> ScenarioDescription:
        """Convert one record to a scenario.

        Rows that cannot be used are dropped or completed, and listed in the scenario's ``defects`` (see
        :class:`~scenarionet_data.ingest.defects.Defects`).

        Raises:
            InvalidScenario: The record is unusable. It goes to quarantine and the shard continues, as for any other
                exception raised here.
        """

    def dataset_folder(self, raw: Path) -> Path:
        """Folder that contains everything ``raw`` needs: itself, or a parent if ``raw`` is part of a dataset."""
        return raw

    def files(self, shard: Shard) -> Iterator[Iterable[str]]:
        """Files needed to read a shard, for a worker to download from an object store; by default its items.

        Names are relative to the shard's root, and the last part may be a pattern: ``map/*.json``. They are yielded in
        batches: a batch is downloaded to ``shard.root`` before the next one is requested, which may depend on its
        content. Files missing from the store are skipped.
        """
        yield [item.name for item in shard.items]

    def maps(self, raw: str, version: str, options: Any) -> Iterable[Shard]:  # noqa: ARG002
        """List maps shared by many scenarios, for example of a city; empty for most datasets.

        Each is a shard with an empty split whose name is the ``map_id`` of its scenarios. Shared maps are committed
        before any scenario.
        """
        return ()

    def passed_over(
        self,
        raw: str,
        split: str,
        options: Any,  # noqa: ARG002
        shards: Sequence[Shard],
    ) -> Iterable[PassedOver]:
        """List what is below ``raw`` and not used, with reasons, for the report of a conversion.

        By default these are files that are neither inputs of the shards, nor below an input that is a folder, nor
        named by the first batch of ``files`` or ``listed``.

        Args:
            raw, split, options: As for :meth:`shards`.
            shards: The shards that it listed.
        """
        inputs, patterns = set[Path](), set(self.listed)
        for shard in shards:
            inputs.update(shard.paths)
            for name in next(iter(self.files(shard)), ()):
                if "*" in name:
                    patterns.add(name)
                else:
                    inputs.add(Path(shards[0].root, name))

        def is_used(path: Path) -> bool:
            return any(path.match(pattern) for pattern in patterns) or not inputs.isdisjoint((path, *path.parents))

        return unused_files(Path(raw), is_used, split, self.ignored)

    def map_features(self, shard: Shard) -> MapBuilder:
        """Read a shared map, on a worker; features that cannot be used are dropped and listed in its ``defects``.

        Raises:
            CorruptSource: The map cannot be read.
        """
        raise NotImplementedError(f"{self.name} has no shared map {shard.name}")


def find_files(
    raw: str, pattern: str, what: str, split: str | None = None, sidecars: tuple[str, ...] = ()
) -> list[Path]:
    """Return the files below ``raw`` that match a glob pattern, sorted; ``raw`` may be such a file itself.

    Args:
        raw: Folder or file.
        pattern: Glob, for example ``"*.tfrecord*"``.
        what: Description of these files, for error messages.
        split: Skip folders named after another split.
        sidecars: Skip files with these endings, for example checksums.

    Raises:
        SourceNotFound: No such folder, or no matching file.
    """
    root = Path(raw)
    if root.is_file() and root.match(pattern) and not root.name.endswith(sidecars):
        return [root]
    if not root.is_dir():
        raise SourceNotFound(f"{raw}: no such folder; give the folder with {what}")
    named = (Path(folder, name) for folder, _, names in walk(root) for name in names if fnmatchcase(name, pattern))
    matching = [path for path in named if not path.name.endswith(sidecars) and path.is_file()]
    found = [path for path in matching if not split or is_of_split(path, root, split)]
    if matching and not found:
        raise SourceNotFound(
            f"{raw}: nothing named {pattern} of split {split} in it; it has the splits "
            f"{', '.join(splits_of(matching, root))}"
        )
    if not found:
        raise SourceNotFound(f"{raw}: nothing named {pattern} in it; give the folder with {what}")
    return sorted(found)


_CHECKSUMS = (".md5", ".sha1", ".sha256", ".crc32", ".crc32c", ".sig", ".asc")
_PARTIAL = (".gstmp", ".part", ".partial", ".tmp", ".crdownload", ".aria2")


def unused_files(
    raw: Path, is_used: Callable[[Path], bool], split: str = "", ignored: Collection[str] = ()
) -> Iterator[PassedOver]:
    """Yield the files below a folder that are not used, grouped by ending and reason, with an example of each.

    Args:
        raw: The folder; nothing is yielded for anything else.
        is_used: Whether a conversion uses a file.
        split: Split that is converted: files below folders named after others are grouped by that.
        ignored: Names of folders that are counted and not searched.
    """
    groups: Counter[tuple[str, str]] = Counter()
    examples: dict[tuple[str, str], str] = {}
    for place, folders, files in walk(raw):
        inside = [f"folders {name}" for name in folders if name in ignored]
        folders[:] = sorted(name for name in folders if name not in ignored)
        found = [(what, "its content is not read", what.removeprefix("folders ")) for what in inside]
        for name in sorted(files):
            path = Path(place, name)
            if not is_used(path):
                _, dot, ending = name.rpartition(".")
                pattern = f"*.{re.sub('[0-9]{3,}', 'N', ending)}" if dot and ending else name
                found.append((f"files {pattern}", _reason(path, raw, split), name))
        for what, reason, name in found:
            groups[what, reason] += 1
            examples.setdefault((what, reason), Path(place, name).relative_to(raw).as_posix())
    for (what, reason), count in sorted(groups.items()):
        example = examples[what, reason]
        yield PassedOver(f"{what}: {example}" if count == 1 else f"{what}, for example {example}", count, reason)


def counted(what: str, count: int, reason: str) -> Iterator[PassedOver]:
    """Yield a group if there is anything in it."""
    if count:
        yield PassedOver(what, count, reason)


def _reason(path: Path, raw: Path, split: str) -> str:
    if split and not is_of_split(path, raw, split):
        return f"of another split than {split}"
    if path.name.endswith(_PARTIAL):
        return "an unfinished download"
    if path.name.endswith(_CHECKSUMS):
        return "a checksum"
    return "not read by this converter"
