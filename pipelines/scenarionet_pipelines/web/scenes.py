"""Scenarios for the browser, by id: thumbnails and packed scenes, the latest of them kept."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable, Sequence
from typing import Any, Generic, TypeVar

from scenarionet_data import Lake, ScenarioLoader
from scenarionet_data.plots import thumbnail
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_pipelines.web.packing import pack

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

    def get(self, key: Hashable) -> Value | None:
        """What is held for a key; None when nothing is."""
        with self._lock:
            if key in self._held:
                self._held.move_to_end(key)
            return self._held.get(key)

    def put(self, key: Hashable, value: Value) -> None:
        """Hold a value."""
        with self._lock:
            self._held[key] = value
            self._held.move_to_end(key)
            while len(self._held) > self._most:
                self._held.popitem(last=False)

    def get_or(self, key: Hashable, make: Callable[[], Value]) -> Value:
        """What is held for a key, or is made now."""
        held = self.get(key)
        if held is None:
            held = make()
            self.put(key, held)
        return held


class Scenes:
    """The scenarios of a lake.

    Looking up where scenarios lie takes a while among a million: it is done once a page of the table, when the first
    picture of it is wanted, and on a connection of its own, so that filters do not wait for it.

    Args:
        lake: The lake; ids are looked up in its snapshot.
    """

    def __init__(self, lake: Lake) -> None:
        self._lake = Lake(lake.root, lake.snapshot.number, lake.user_columns)
        self._pages: Latest[tuple[str, ...]] = Latest(_MOST_PLACES)
        self._places: Latest[tuple[ScenarioLoader, int]] = Latest(_MOST_PLACES)
        self._thumbnails: Latest[bytes] = Latest(_MOST_THUMBNAILS)
        self._packed: Latest[bytes] = Latest(_MOST_SCENES)
        self._looking = threading.Lock()

    def expect(self, scenario_ids: Sequence[str]) -> None:
        """These are shown together: whoever is asked for, all will be."""
        page = tuple(scenario_ids)
        for scenario_id in page:
            self._pages.put(scenario_id, page)

    def facts(self, scenario_id: str) -> dict[str, Any]:
        """Properties of a scenario; see ``Lake.describe``."""
        return self._lake.describe(scenario_id)

    def thumbnail(self, scenario_id: str, size: tuple[int, int]) -> bytes:
        """A small picture of it (PNG), of so many pixels.

        Raises:
            ScenarioNotFound: There is none of that id.
        """
        return self._thumbnails.get_or((scenario_id, size), lambda: thumbnail(self._load(scenario_id), size))

    def packed(self, scenario_id: str) -> bytes:
        """It, as ``packing`` writes it.

        Raises:
            ScenarioNotFound: There is none of that id.
        """
        return self._packed.get_or(scenario_id, lambda: pack(self._load(scenario_id)))

    def _load(self, scenario_id: str) -> ScenarioDescription:
        with self._looking:  # the others of its page wait, and then are there
            loader, index = self._places.get(scenario_id) or self._look_up(scenario_id)
        scenario: ScenarioDescription = loader[index]
        return scenario

    def _look_up(self, scenario_id: str) -> tuple[ScenarioLoader, int]:
        """Find a scenario, and those that are shown with it."""
        page = self._pages.get(scenario_id) or (scenario_id,)
        loader = ScenarioLoader(self._lake, page)
        for index, each in enumerate(page):
            self._places.put(each, (loader, index))
        return loader, page.index(scenario_id)
