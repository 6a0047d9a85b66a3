"""Scenarios that were read last, in memory of a fixed size."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Int64
from scenarionet_data.samples.choices import Choices
from scenarionet_data.samples.scene_kernels import ALIGNMENT, WORD, Cutting, SceneMemory, measure, store
from scenarionet_data.samples.scene_rows import SceneReader
from scenarionet_data.samples.selection import Selection


class SceneCache:
    """The scenarios that were read last, as blocks of memory that kernels read; for one thread.

    The memory grows to its limit as it is filled; from then on it is filled from its start again, and a block displaces
    the oldest ones.

    Args:
        reader: Reads the others.
        selection: The samples.
        choices: Their polylines.
        limit: Bytes of memory; as many more as the largest scenario needs.
        num_scenarios: Number of all scenarios.

    Attributes:
        memory: The blocks.
        target_rows: (targets,) int32 row of each target of the selection in its scenario, once this was read; -1 for
            one that it does not have.
        ego_rows: (scenarios,) int32 the same of each ego.
    """

    def __init__(
        self, reader: SceneReader, selection: Selection, choices: Choices, limit: int, num_scenarios: int
    ) -> None:
        self.reader, self._selection, self._polylines, self._limit = reader, selection, choices.polylines, limit
        self._blocks = np.full(num_scenarios, -1, np.int64)
        self._kept: deque[tuple[int, int, int]] = deque()  # scenario, first byte and end of its block; oldest first
        self._end = 0  # of the newest block
        self.memory = _memory(0)
        self.target_rows = np.full(len(selection.target_ids), -1, np.int32)
        self.ego_rows = np.full(num_scenarios, -1, np.int32)

    def __len__(self) -> int:
        return len(self._kept)

    @property
    def num_bytes(self) -> int:
        """Size of the memory."""
        return len(self.memory.bytes)

    def prefetch(self, scenarios: Array) -> None:
        """Request those of some scenarios that are not in the cache from an object store."""
        self.reader.prefetch(np.unique(scenarios[self._blocks[scenarios] < 0]))

    def blocks(self, scenarios: Array) -> Iterator[Int64]:
        """Place of each scenario's block [words], in parts, with -1 for those of other parts; valid until the next one.

        Args:
            scenarios: (B,) numbers of scenarios.

        Raises:
            LakeError: A file is missing or damaged.
        """
        blocks = self._blocks[scenarios]
        missing = np.unique(scenarios[blocks < 0])
        if (blocks >= 0).any():
            yield blocks
        if not len(missing):
            return
        rows = self.reader.read(missing)
        bounds, ids = self._selection.target_bounds, self._selection.target_ids
        for scenario, row, names in zip(missing.tolist(), rows.metadata, rows.track_ids(), strict=True):
            place_of = {name: place for place, name in enumerate(names)}
            first, end = bounds[scenario], bounds[scenario + 1]
            self.ego_rows[scenario] = place_of.get(row["ego_id"], -1)
            self.target_rows[first:end] = [place_of.get(name, -1) for name in ids[first:end].to_pylist()]
        tracks, features, times = rows.track_lists(), rows.map_lists(), rows.times()
        steps = self.reader.memory.empty(len(features.x) + len(features.outline_x), np.float64)
        counts = np.empty(len(features.kind), np.int32)
        cutting = Cutting(self._polylines.spacing, self._polylines.points, steps, counts)
        numbers = np.empty((len(missing), 2), np.int64)
        measure(tracks, features, times, cutting, numbers)
        done = 0
        while done < len(missing):
            places = self._make_room(missing[done:], numbers[done:, 0])
            part = np.full(len(missing), -1, np.int64)
            part[done : done + len(places)] = places
            store(tracks, features, times, cutting, numbers, part, self.memory)
            done += len(places)
            self._blocks[missing] = np.where(part >= 0, part, self._blocks[missing])
            places_of = np.searchsorted(missing, scenarios).clip(max=len(missing) - 1)
            yield np.where(missing[places_of] == scenarios, part[places_of], -1)

    def _make_room(self, scenarios: Array, sizes: Int64) -> list[int]:
        """Place the first of some scenarios, as many as there is room for at once; returns their places [words]."""
        self._grow(self._end + int(sizes.sum()), max(self._limit, int(sizes[0])))
        placed: list[int] = []
        new: set[int] = set()
        for scenario, size in zip(scenarios.tolist(), sizes.tolist(), strict=True):
            first = self._end
            is_room = self._displace(first, min(first + size, self.num_bytes), new)
            if first + size > self.num_bytes:
                first = 0
                is_room = is_room and size <= self.num_bytes and self._displace(0, size, new)
            if not is_room:
                break
            self._end = first + size
            self._kept.append((scenario, first, self._end))
            new.add(scenario)
            placed.append(first // WORD)
        return placed

    def _grow(self, wanted: int, most: int) -> None:
        """Take memory up to a place, at least as much again, so that little is copied; at most ``most`` bytes."""
        size = min(max(wanted, 2 * self.num_bytes), most) // ALIGNMENT * ALIGNMENT
        if self.num_bytes < min(wanted, size):
            grown = _memory(size)
            grown.bytes[: self.num_bytes] = self.memory.bytes
            self.memory = grown

    def _displace(self, first: int, end: int, new: set[int]) -> bool:
        """Forget the oldest blocks between two places; returns whether none of them is new."""
        while self._kept and self._kept[0][1] < end and first < self._kept[0][2]:
            if self._kept[0][0] in new:
                return False
            self._blocks[self._kept.popleft()[0]] = -1
        return True


def _memory(size: int) -> SceneMemory:
    """Memory of some bytes."""
    doubles = np.empty(size // 8, np.float64)
    return SceneMemory(doubles.view(np.int32), doubles.view(np.float32), doubles, doubles.view(np.uint8))
