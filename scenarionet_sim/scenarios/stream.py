"""Scenarios on their way into episodes: drawn ahead, loaded in a thread beside the steps, the last ones kept.

What is drawn next is settled before it is needed, so a curriculum's promotion takes hold ``ahead`` episodes later;
the series depends on the seed and the episodes' results alone, never on how fast the thread is.
"""

from __future__ import annotations

from collections import OrderedDict, deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Generic, TypeVar

from scenarionet_data.errors import BadParameter, ScenarioNotFound
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_sim.scenarios.sampling import Sampler

Prepared = TypeVar("Prepared")


class Stream(Generic[Prepared]):
    """An endless series of prepared scenarios.

    Args:
        ids: Id of each scenario.
        load: Reads scenario ``index``.
        prepare: Makes of a scenario what an episode needs, for example a ``World``.
        sampler: Draws indices.
        ahead: How many to draw and load ahead; 0 loads when asked.
        keep: How many prepared scenarios to keep: the memory stays that of so many.
    """

    def __init__(
        self,
        ids: Sequence[str],
        load: Callable[[int], ScenarioDescription],
        prepare: Callable[[ScenarioDescription], Prepared],
        sampler: Sampler,
        *,
        ahead: int = 1,
        keep: int = 32,
    ) -> None:
        if ahead < 0 or keep < 1:
            raise BadParameter(f"wanted ahead from 0 and keep from 1, found ahead={ahead}, keep={keep}")
        self.ids = ids
        self.sampler = sampler
        self._load, self._prepare = load, prepare
        self._ahead, self._keep = ahead, keep
        self._drawn: deque[int] = deque()
        self._kept: OrderedDict[int, Future[Prepared]] = OrderedDict()
        self._thread: ThreadPoolExecutor | None = None

    def restart(self, seed: int) -> None:
        """Begin the series again; what is loaded is kept."""
        self.sampler.restart(seed)
        self._drawn.clear()

    def next(self) -> tuple[int, Prepared]:
        """The next scenario's number and what was made of it.

        Raises:
            ScenarioNetError: It cannot be read or prepared; asked again, the series goes on behind it.
        """
        drawn = self._drawn.popleft() if self._drawn else self.sampler.draw()
        prepared = self.get(drawn)
        while len(self._drawn) < self._ahead:
            self._drawn.append(self.sampler.draw())
            self._start(self._drawn[-1])
        return drawn, prepared

    def get(self, index: int) -> Prepared:
        """Scenario ``index``, out of the series."""
        if index in self._kept and self._kept[index].done() and self._kept[index].exception():
            del self._kept[index]  # it may have been mended since
        if index not in self._kept and not self._ahead:
            self._remember(index, _done(self._prepare(self._load(index))))
        return self._start(index).result()

    def number(self, scenario_id: str) -> int:
        """The number of a scenario.

        Raises:
            ScenarioNotFound: It is not one of these.
        """
        if scenario_id not in self.ids:
            raise ScenarioNotFound(f"{scenario_id} is none of the {len(self.ids)} scenarios of this environment")
        return self.ids.index(scenario_id)

    def close(self) -> None:
        """End the thread; a stream that is used again starts another."""
        if self._thread is not None:
            self._thread.shutdown(wait=True, cancel_futures=True)
            self._thread = None
        self._kept.clear()
        self._drawn.clear()

    def _start(self, index: int) -> Future[Prepared]:
        """The scenario, loaded or on its way."""
        if index in self._kept:
            self._kept.move_to_end(index)
            return self._kept[index]
        if self._thread is None:
            self._thread = ThreadPoolExecutor(1, thread_name_prefix="scenarios")
        return self._remember(index, self._thread.submit(lambda: self._prepare(self._load(index))))

    def _remember(self, index: int, made: Future[Prepared]) -> Future[Prepared]:
        self._kept[index] = made
        while len(self._kept) > max(self._keep, self._ahead + 1):
            self._kept.popitem(last=False)
        return made


def _done(value: Prepared) -> Future[Prepared]:
    future: Future[Prepared] = Future()
    future.set_result(value)
    return future
