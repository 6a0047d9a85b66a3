"""An endless series of prepared scenarios, prefetched in a background thread and cached.

Draws are made before they are needed, so a curriculum's promotion takes effect ``prefetch`` episodes later. The series
depends only on the seed and on the results of episodes, never on the speed of the thread.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, Generic, TypeVar

import numpy as np
import pyarrow as pa

from scenarionet_data.arrays.dtypes import Int64, is_count
from scenarionet_data.errors import BadParameter, ScenarioNotFound
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_sim.scenarios.sampling import Sampler

Prepared = TypeVar("Prepared")

_DRAWN_AHEAD = 256
"""Scenarios to draw at once if their series does not depend on the results of episodes."""

_NONE: Int64 = np.zeros(0, np.int64)


class ScenarioStream(Generic[Prepared]):
    """An endless series of prepared scenarios.

    Args:
        ids: Id of each scenario.
        load: Reads the scenario with an index.
        prepare: Converts a scenario into what an episode needs, for example a ``World``.
        sampler: Draws indices.
        prefetch: Number of scenarios to draw and load ahead; 0 loads on demand.
        cache_size: Number of prepared scenarios to keep; bounds the memory.
    """

    def __init__(
        self,
        ids: Sequence[str],
        load: Callable[[int], ScenarioDescription],
        prepare: Callable[[ScenarioDescription], Prepared],
        sampler: Sampler,
        *,
        prefetch: int = 1,
        cache_size: int = 32,
    ) -> None:
        if not is_count(prefetch) or not is_count(cache_size, 1):
            raise BadParameter(
                f"expected prefetch >= 0 and cache_size >= 1, found prefetch={prefetch}, cache_size={cache_size}"
            )
        self.ids = ids
        self.sampler = sampler
        self._load, self._prepare = load, prepare
        self._prefetch, self._cache_size = prefetch, cache_size
        self._drawn: Int64 = _NONE  # some of the next ones, from number ``_at`` on
        self._at = 0
        self._cache: OrderedDict[int, Future[Prepared]] = OrderedDict()
        self._thread: ThreadPoolExecutor | None = None

    def restart(self, seed: int) -> None:
        """Restart the series with a seed; loaded scenarios stay cached."""
        self.sampler.restart(seed)
        self._drawn, self._at = _NONE, 0

    def state(self) -> dict[str, Any]:
        """Return where the series stands, JSON-serialisable."""
        return {"sampler": self.sampler.state(), "drawn": self._drawn[self._at :].tolist()}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue where another stream of the same scenarios stood."""
        self.sampler.restore(state["sampler"])
        self._drawn, self._at = np.array(state["drawn"], np.int64), 0

    def draw(self) -> int:
        """Return the index of the next scenario."""
        if self._at == len(self._drawn):
            return self.sampler.draw()
        self._at += 1
        return int(self._drawn[self._at - 1])

    def coming(self, count: int) -> Int64:
        """Return the indices of the next scenarios, and of those to load ahead after them; :meth:`take` draws them."""
        end = self._at + count + self._prefetch
        if end > len(self._drawn):
            more = end - len(self._drawn) + (0 if self.sampler.is_adaptive else _DRAWN_AHEAD)
            self._drawn = np.concatenate([self._drawn[self._at :], np.array(self.sampler.draw_all(more), np.int64)])
            self._at, end = 0, count + self._prefetch
        return self._drawn[self._at : end]

    def take(self, count: int) -> None:
        """Draw the next scenarios, which were coming."""
        self._at += count

    def load_ahead(self, is_stored: Callable[[int], bool] = lambda _: False) -> None:
        """Load the next scenarios in the background, but those that are stored elsewhere."""
        for index in self.coming(0).tolist():
            if not is_stored(index):
                self._submit(index)

    def get(self, index: int) -> Prepared:
        """Return the scenario with an index, without a draw."""
        if index in self._cache and self._cache[index].done() and self._cache[index].exception():
            del self._cache[index]  # retry, the file may have been repaired
        return self._submit(index).result()

    def index(self, scenario_id: str) -> int:
        """Return the index of a scenario id.

        Raises:
            ScenarioNotFound: The id is not among the selected scenarios.
        """
        if scenario_id not in self.ids:
            raise ScenarioNotFound(f"{scenario_id} is not among the {len(self.ids)} scenarios of this environment")
        return self.ids.index(scenario_id)

    def close(self) -> None:
        """Stop the thread and drop the cache; the next use starts a new thread."""
        if self._thread is not None:
            self._thread.shutdown(wait=True, cancel_futures=True)
            self._thread = None
        self._cache.clear()
        self._drawn, self._at = _NONE, 0

    def _prepared(self, index: int) -> Prepared:
        """Load and prepare a scenario."""
        prepared = self._prepare(self._load(index))
        pa.default_memory_pool().release_unused()  # some 10 MB that were needed to decode it
        return prepared

    def _submit(self, index: int) -> Future[Prepared]:
        """Return the cached or pending scenario; without prefetching, load it in the calling thread."""
        if index in self._cache:
            self._cache.move_to_end(index)
            return self._cache[index]
        if self._prefetch:
            if self._thread is None:
                self._thread = ThreadPoolExecutor(1, thread_name_prefix="scenarios")
            future = self._thread.submit(self._prepared, index)
        else:
            future = Future()
            future.set_result(self._prepared(index))
        self._cache[index] = future
        while len(self._cache) > max(self._cache_size, self._prefetch + 1):
            self._cache.popitem(last=False)
        return future
