"""Samples for forecasting, straight from the lake."""

from __future__ import annotations

import threading
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Int64, UInt64, is_count
from scenarionet_data.databases.record import DatabaseRecord
from scenarionet_data.errors import BadParameter
from scenarionet_data.loader import ScenarioLoader
from scenarionet_data.query.lake_view import LakeLike, open_view
from scenarionet_data.samples.choices import (
    Agents,
    Augmentation,
    Choices,
    Polylines,
    Targets,
    TimeWindow,
    part_of,
)
from scenarionet_data.samples.forecasting import forecasting
from scenarionet_data.samples.scene_cache import SceneCache
from scenarionet_data.samples.scene_rows import MAP_COLUMNS, TRACK_COLUMNS, SceneReader
from scenarionet_data.samples.scenes import Requests, Scenes
from scenarionet_data.samples.selection import SamplesWarning, select
from scenarionet_data.samples.unitraj import unitraj
from scenarionet_data.storage.read.metadata_rows import ADDRESS_COLUMNS

Sample: TypeAlias = Mapping[str, Array]
"""Arrays of a sample by name; of a batch, with the samples along the first axis."""


@dataclass(frozen=True)
class SampleLayout:
    """How samples are made of scenarios.

    Attributes:
        make: A function from scenarios and choices to the arrays of a batch.
        tracks, maps: Columns of these tables that it needs; all by default.
    """

    make: Callable[[Scenes, Choices], Mapping[str, Array]]
    tracks: frozenset[str] | None = None
    maps: frozenset[str] | None = None

    def __post_init__(self) -> None:
        if not callable(self.make):
            raise BadParameter(f"make={self.make!r}; expected a function of scenarios and choices")

    @property
    def columns(self) -> Mapping[str, frozenset[str]] | None:
        """Columns by table; None for all."""
        return None if self.tracks is None or self.maps is None else {"tracks": self.tracks, "maps": self.maps}


FORECASTING = SampleLayout(forecasting, TRACK_COLUMNS, MAP_COLUMNS)
"""Agents and map around each target, see :func:`.forecasting.forecasting`."""

UNITRAJ = SampleLayout(unitraj)
"""The arrays of UniTraj's datasets, see :func:`.unitraj.unitraj`."""


_METADATA = (
    *("scenario_id", "dataset", "version", "num_timesteps", "dt", "timestamps", "ego_id", "map_id", "map_crop"),
    *("origin_x", "origin_y", "origin_z"),
    *(name for name in ADDRESS_COLUMNS if not name.startswith("lights")),
)
"""Columns of the metadata table that layouts over columns need."""


class SampleKey(NamedTuple):
    """What a sample shows: scenario, current timestep, and targets."""

    scenario_id: str
    timestep: int
    track_ids: tuple[str, ...]


class Samples(Sequence[Sample]):
    """Samples of a database (or of ids, or of a whole lake) as a sequence of named arrays.

    Nothing is cached on disk: a batch reads the columns and row groups of the scenarios that are not in memory. Works
    in worker processes and threads, like :class:`ScenarioLoader`.

    Args:
        lake: The lake, its path or its URL.
        database: A database, its name, or scenario ids; by default all scenarios.
        window, agents, polylines, targets, augmentation: What a sample contains; ``window=(1.0, 3.0)`` is short for
            ``TimeWindow(history=1.0, future=3.0)``, ``targets="moving"`` for ``Targets("moving")``.
        perspective: ``agent``: one sample per target; ``scene``: one per scenario, around the ego.
        layout: How samples are made; a function of ``Scenes`` and ``Choices`` for a layout of your own.
        cache_bytes: Memory that each thread or worker keeps scenarios in that it read, for the next samples of them; at
            least that of one scenario.

    Attributes:
        choices: What a sample contains.
        findings: Number of scenarios, and an example, by why they give no samples, or interpolated ones.

    Raises:
        ScenarioNotFound: The lake does not have a scenario.

    Example:
        samples = Samples("lake", "busy", window=TimeWindow(future=3.0), targets=Targets("moving"))
        batch = samples.batch(range(32))
        batch["history"]  # (32, 64, 11, 5) float32
    """

    def __init__(
        self,
        lake: LakeLike,
        database: DatabaseRecord | str | Iterable[str] | None = None,
        *,
        window: TimeWindow | tuple[float, ...] | None = None,
        agents: Agents | None = None,
        polylines: Polylines | None = None,
        targets: Targets | str | None = None,
        augmentation: Augmentation | None = None,
        perspective: Literal["agent", "scene"] = "agent",
        layout: SampleLayout | Callable[[Scenes, Choices], Mapping[str, Array]] = FORECASTING,
        cache_bytes: int = 2**29,
    ) -> None:
        self.choices = Choices(
            part_of(TimeWindow, "window", window),
            part_of(Agents, "agents", agents),
            part_of(Polylines, "polylines", polylines),
            part_of(Targets, "targets", targets),
            part_of(Augmentation, "augmentation", augmentation),
            perspective,
        )
        if not (isinstance(layout, SampleLayout) or callable(layout)):
            raise BadParameter(f"layout: expected FORECASTING, UNITRAJ or a function, found {layout!r}")
        if not is_count(cache_bytes, 0):
            raise BadParameter(f"cache_bytes: expected a whole number of 0 or more, found {cache_bytes!r}")
        self._cache_bytes = cache_bytes
        self.layout = layout if isinstance(layout, SampleLayout) else SampleLayout(layout)
        view, rows = open_view(lake).find(database)
        self._rows = rows if self.layout.columns is None else rows.select(_METADATA)
        self._files, self._snapshot = view.files, view.snapshot
        self._selection = select(view, self._rows, self.choices)
        self._loader = ScenarioLoader.of_rows(view, rows)
        self._has_warned = False
        self._local = threading.local()

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "_local"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state, _local=threading.local())

    def __repr__(self) -> str:
        return f"Samples({str(self._files.root)!r}, {len(self):,} samples of {len(self._rows):,} scenarios)"

    @property
    def findings(self) -> Mapping[str, tuple[int, str]]:
        """Number of scenarios, and an example, by why they give no samples, or interpolated ones."""
        return self._selection.findings

    def __len__(self) -> int:
        return len(self._selection)

    def __getitem__(self, index: Any) -> Any:
        """Sample ``index``; a batch for a slice."""
        if isinstance(index, slice):
            return self.batch(range(len(self))[index])
        return MappingProxyType({name: values[0] for name, values in self.batch([index]).items()})

    def key(self, index: int) -> SampleKey:
        """What sample ``index`` shows."""
        number = int(self._numbers([index])[0])
        scenario_id = self._rows.ids[int(self._selection.scene[number])].as_py()
        return SampleKey(scenario_id, int(self._selection.moment[number]), self._selection.targets(number))

    def __getitems__(self, indices: Sequence[int]) -> Sample:
        """Call :meth:`batch`; torch's ``DataLoader`` uses this name."""
        return self.batch(indices)

    def batch(self, indices: Sequence[int] | Int64, epoch: int = 0) -> Sample:
        """Samples at ``indices`` as joined arrays.

        Args:
            indices: Numbers of samples, in any order.
            epoch: Pass over the data: other epochs are augmented otherwise.

        Raises:
            IndexError: There is no such sample.
            LakeError: A file is missing or damaged.
        """
        numbers = self._numbers(indices)
        if not is_count(epoch, 0):
            raise BadParameter(f"epoch: expected a whole number of 0 or more, found {epoch!r}")
        selection = self._selection
        scenes, scene = np.unique(selection.scene[numbers], return_inverse=True)
        self._loader.compare(scenes.tolist())
        keys = _keys(self.choices.augmentation.seed, epoch, numbers)
        requests = Requests(selection, numbers, scenes, scene.astype(np.int32), keys)
        made = dict(self.layout.make(Scenes(requests, self._cache.reader, self._cache), self.choices))
        unseen = numbers[~made["has_centre"]] if "has_centre" in made else numbers[:0]
        if len(unseen) and not self._has_warned:
            self._has_warned = True
            text = f"{self.key(int(unseen[0]))} is not seen at the current timestep: such samples are masked"
            warnings.warn(SamplesWarning(text), stacklevel=2)
        return MappingProxyType(made)

    def prefetch(self, indices: Sequence[int] | Int64) -> None:
        """Request what a later batch needs from an object store; nothing for a local lake."""
        self._cache.prefetch(self._selection.scene[self._numbers(indices)])

    @property
    def places(self) -> Int64:
        """(n,) place on disk of each sample's scenario; neighbours are read together."""
        return self._rows.numbers[self._selection.scene]

    def _numbers(self, indices: Sequence[int] | Int64) -> Int64:
        numbers = np.asarray(indices)
        if numbers.ndim != 1 or not len(numbers) or numbers.dtype.kind not in "iu":
            raise BadParameter(f"expected whole numbers of samples, at least one, as in range(32); found {indices!r}")
        numbers = numbers.astype(np.int64, copy=False)
        outside = (numbers < -len(self)) | (numbers >= len(self))
        if outside.any():
            why = "" if len(self) else ": `findings` says why the scenarios give none"
            raise IndexError(f"sample {numbers[outside][0]} of {len(self)}{why}")
        return numbers % max(len(self), 1)

    @property
    def _cache(self) -> SceneCache:
        """This thread's scenarios."""
        if not hasattr(self._local, "cache"):
            with_map = self.choices.polylines.count > 0
            reader = SceneReader(self._files, self._snapshot, self._rows, self.layout.columns, with_map=with_map)
            self._local.cache = SceneCache(reader, self._selection, self.choices, self._cache_bytes, len(self._rows))
        cache: SceneCache = self._local.cache
        return cache


def _keys(seed: int, epoch: int, numbers: Int64) -> UInt64:
    """(n,) keys of the random numbers of samples: equal for the same seed, epoch and sample only."""
    mixed = (numbers.astype(np.uint64) ^ _key(seed, epoch)) * np.uint64(0xFF51AFD7ED558CCD)
    found: UInt64 = mixed ^ (mixed >> np.uint64(33))
    return found


@lru_cache(16)
def _key(seed: int, epoch: int) -> np.uint64:
    key: np.uint64 = np.random.SeedSequence([seed, epoch]).generate_state(1, np.uint64)[0]
    return key
