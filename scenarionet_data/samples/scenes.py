"""Several scenarios, and the samples that are wanted of them: the input of layouts."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from scenarionet_data import codec
from scenarionet_data.arrays.dtypes import Array, Int32, Int64, UInt64
from scenarionet_data.arrays.memory import Memory
from scenarionet_data.samples.choices import Choices
from scenarionet_data.samples.kernels import Wanted
from scenarionet_data.samples.scene_cache import SceneCache
from scenarionet_data.samples.scene_rows import SceneReader
from scenarionet_data.samples.selection import Selection
from scenarionet_data.scenario.description import ScenarioDescription


@dataclass(frozen=True, eq=False)
class Requests:
    """Samples of some scenarios.

    Attributes:
        selection: All samples.
        numbers: (B,) int64 those that are wanted.
        scenarios: (S,) number of each scenario.
        scene: (B,) int32 scenario of each sample, among these.
        keys: (B,) uint64 keys of random numbers.
    """

    selection: Selection
    numbers: Int64
    scenarios: Array
    scene: Int32
    keys: UInt64

    @property
    def moment(self) -> Int32:
        """(B,) recorded timestep that is the current one."""
        return self.selection.moment[self.numbers]

    @property
    def targets(self) -> list[tuple[str, ...]]:
        """Ids of the targets of each sample."""
        return [self.selection.targets(number) for number in self.numbers.tolist()]


@dataclass(frozen=True, eq=False)
class Scenes:
    """S scenarios, and B samples that are wanted of them; what a layout does not ask for is not read.

    Attributes:
        requests: The samples.
        reader: Reads scenarios.
        cache: Those that were read before.
    """

    requests: Requests
    reader: SceneReader
    cache: SceneCache

    @property
    def memory(self) -> Memory:
        """Memory for the arrays of samples."""
        return self.reader.memory

    @cached_property
    def metadata(self) -> list[dict[str, Any]]:
        """Metadata row of each scenario."""
        return self.reader.metadata(self.requests.scenarios)

    @cached_property
    def descriptions(self) -> list[ScenarioDescription]:
        """The scenarios whole, for layouts that need all columns of tracks and maps; without traffic lights."""
        rows = self.reader.read(self.requests.scenarios)
        return codec.decode_many(rows.metadata, rows.tracks, None, rows.maps, rows.shared_maps)

    def wanted(self, choices: Choices) -> Iterator[Wanted]:
        """The samples for kernels, in parts: those whose scenarios are in memory, then as many as there is room for."""
        requests, cache, augmentation = self.requests, self.cache, choices.augmentation
        first, counts = requests.selection.first_target[requests.numbers], requests.selection.num_targets
        bounds = np.append(0, np.cumsum(counts[requests.numbers]))
        targets = np.repeat(first - bounds[:-1], np.diff(bounds)) + np.arange(bounds[-1])
        # Two numbers in [0, 1) of each key: SplitMix64 (Steele, Lea, Flood 2014).
        keys = requests.keys ^ np.uint64(0xA5A5A5A5A5A5A5A5)
        state = keys[:, None] + np.arange(1, 3, dtype=np.uint64) * np.uint64(0x9E3779B97F4A7C15)
        state = (state ^ (state >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        state = (state ^ (state >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        draws = ((state ^ (state >> np.uint64(31))) >> np.uint64(11)).astype(np.float64) * 2.0**-53
        angle = augmentation.rotation * (2.0 * draws[:, 0] - 1.0)
        mirror = np.where(draws[:, 1] < augmentation.flip, -1.0, 1.0)
        scenarios = requests.scenarios[requests.scene]
        for blocks in cache.blocks(scenarios):
            rows = cache.target_rows[targets]
            centre = rows if choices.perspective == "agent" else cache.ego_rows[scenarios]
            yield Wanted(blocks, requests.moment, centre, bounds, rows, angle, mirror, requests.keys)
