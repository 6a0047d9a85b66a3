"""Scenarios for the browser, by id: thumbnails and packed scenes, the latest of them kept."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable, Sequence
from typing import Generic, TypeVar

from pipelines.web.packing import pack
from scenarionet_data import Lake, ScenarioLoader
from scenarionet_data.plots import thumbnail
from scenarionet_data.scenario import ScenarioDescription

Value = TypeVar("Value")

_MOST_PLACES = 10_000
_MOST_THUMBNAILS = 4_000
_MOST_SCENES = 16


class Latest(Generic[Value]):
    """A mapping that forgets what was not used for longest; threads may share it."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._held: OrderedDict[Hashable, Value] = OrderedDict()
        self._lock = threading.Lock()

    def get(self, key: Hashable, make: Callable[[], Value]) -> Value:
        """What is held for a key, or is made now."""
        with self._lock:
            if key in self._held:
                self._held.move_to_end(key)
                return self._held[key]
        made = make()
        self.put(key, made)
        return made

    def put(self, key: Hashable, value: Value) -> None:
        """Hold a value."""
        with self._lock:
            self._held[key] = value
            self._held.move_to_end(key)
            while len(self._held) > self._most:
                self._held.popitem(last=False)


class Scenes:
    """The scenarios of a lake.

    Args:
        lake: The lake; ids are looked up in its snapshot.
    """

    def __init__(self, lake: Lake) -> None:
        self._lake = lake
        self._places: Latest[tuple[ScenarioLoader, int]] = Latest(_MOST_PLACES)
        self._thumbnails: Latest[bytes] = Latest(_MOST_THUMBNAILS)
        self._packed: Latest[bytes] = Latest(_MOST_SCENES)
        self._looking = threading.Lock()

    def expect(self, scenario_ids: Sequence[str]) -> None:
        """Look up where scenarios lie, all in one question."""
        with self._looking:
            loader = ScenarioLoader(self._lake, scenario_ids)
            for index, scenario_id in enumerate(scenario_ids):
                self._places.put(scenario_id, (loader, index))

    def thumbnail(self, scenario_id: str, size: tuple[int, int]) -> bytes:
        """A small picture of it (PNG), of so many pixels.

        Raises:
            ScenarioNotFound: There is none of that id.
        """
        return self._thumbnails.get((scenario_id, size), lambda: thumbnail(self._load(scenario_id), size))

    def packed(self, scenario_id: str) -> bytes:
        """It, as ``packing`` writes it.

        Raises:
            ScenarioNotFound: There is none of that id.
        """
        return self._packed.get(scenario_id, lambda: pack(self._load(scenario_id)))

    def _load(self, scenario_id: str) -> ScenarioDescription:
        with self._looking:  # while a page's scenarios are looked up, its thumbnails wait for that
            loader, index = self._places.get(scenario_id, lambda: (ScenarioLoader(self._lake, [scenario_id]), 0))
        scenario: ScenarioDescription = loader[index]
        return scenario
