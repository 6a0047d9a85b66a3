"""Cached scenarios for the browser: thumbnails, packed scenes and pictures of cameras by scenario id."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterator, Sequence
from typing import Any, Generic, TypeVar

from scenarionet_data import Lake, ScenarioLoader
from scenarionet_data.plots import thumbnail
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_pipelines.web.camera_views import CameraView, Footage
from scenarionet_pipelines.web.clips import stream_clip
from scenarionet_pipelines.web.packing import pack
from scenarionet_pipelines.web.runs import pack_run, runs_of

Value = TypeVar("Value")

_MAX_LOCATIONS = 10_000
_MAX_THUMBNAILS = 4_000
_MAX_PACKED = 16
_MAX_FOOTAGE = 4
_MAX_SEEN = 500


class LruCache(Generic[Value]):
    """A thread-safe mapping that drops the least recently used entry.

    Args:
        max_size: Maximum number of entries.
    """

    def __init__(self, max_size: int) -> None:
        self._max_size = max_size
        self._entries: OrderedDict[Hashable, Value] = OrderedDict()
        self._lock = threading.Lock()

    def get(self, key: Hashable) -> Value | None:
        """Return the value of a key, or None."""
        with self._lock:
            if key in self._entries:
                self._entries.move_to_end(key)
            return self._entries.get(key)

    def put(self, key: Hashable, value: Value) -> None:
        """Store a value."""
        with self._lock:
            self._entries[key] = value
            self._entries.move_to_end(key)
            while len(self._entries) > self._max_size:
                self._entries.popitem(last=False)

    def get_or(self, key: Hashable, make: Callable[[], Value]) -> Value:
        """Return the value of a key, creating it if it is missing."""
        value = self.get(key)
        if value is None:
            value = make()
            self.put(key, value)
        return value


class ScenarioCache:
    """Loads and caches scenarios of a lake.

    Locating scenarios among a million is slow, so it is done once per page of the table, when its first picture
    is requested, and on a separate connection, so that filters do not wait.

    Args:
        lake: The lake; its snapshot is read.
    """

    def __init__(self, lake: Lake) -> None:
        self._lake = Lake(lake.root, lake.snapshot.number, lake.user_columns)
        self._pages: LruCache[tuple[str, ...]] = LruCache(_MAX_LOCATIONS)
        self._locations: LruCache[tuple[ScenarioLoader, int]] = LruCache(_MAX_LOCATIONS)
        self._thumbnails: LruCache[bytes] = LruCache(_MAX_THUMBNAILS)
        self._packed: LruCache[bytes] = LruCache(_MAX_PACKED)
        self._footage: LruCache[Footage] = LruCache(_MAX_FOOTAGE)
        self._seen: LruCache[bytes] = LruCache(_MAX_SEEN)
        self._lookup_lock = threading.Lock()

    def expect(self, scenario_ids: Sequence[str]) -> None:
        """Note that these scenarios are shown together: the first request locates all of them."""
        page = tuple(scenario_ids)
        for scenario_id in page:
            self._pages.put(scenario_id, page)

    def facts(self, scenario_id: str) -> dict[str, Any]:
        """Return the metadata of a scenario."""
        return self._lake.describe(scenario_id)

    def thumbnail(self, scenario_id: str, size: tuple[int, int]) -> bytes:
        """Return a small picture.

        Args:
            scenario_id: Id of the scenario.
            size: Width and height [pixel].

        Returns:
            A PNG file.

        Raises:
            ScenarioNotFound: No scenario has that id.
        """
        return self._thumbnails.get_or((scenario_id, size), lambda: thumbnail(self._load(scenario_id), size))

    def packed(self, scenario_id: str) -> bytes:
        """Return a scenario in the binary format of ``packing``.

        Raises:
            ScenarioNotFound: No scenario has that id.
        """
        return self._packed.get_or(scenario_id, lambda: pack(self._load(scenario_id)))

    def runs(self, scenario_id: str) -> list[dict[str, Any]]:
        """Return the results of all runs of a scenario; see :func:`runs_of`."""
        return runs_of(self._lake, scenario_id)

    def packed_run(self, scenario_id: str, run: str, rollout: int) -> bytes:
        """Return a rollout in the binary format of ``packing``.

        Raises:
            ScenarioNotFound: No scenario has that id.
            BadParameter: The run has no such rollout of it.
        """
        return pack_run(self._lake, run, rollout, self._load(scenario_id))

    def clip(self, scenario_id: str, runs: Sequence[tuple[str, int]], kind: str) -> Iterator[bytes]:
        """Return progress and content of a clip; see :func:`stream_clip`.

        Raises:
            ScenarioNotFound: No scenario has that id.
        """
        return stream_clip(self._lake, self._load(scenario_id), runs, kind)

    def seen(self, scenario_id: str, run: str, rollout: int, view: CameraView) -> bytes:
        """Return what a camera sees in the recording, or in a run if one is named, as a WebP file.

        Raises:
            ScenarioNotFound: No scenario has that id.
            BadParameter: The run has no such rollout of it, or the object is not there.
        """
        place = scenario_id, run, rollout

        def draw() -> bytes:
            read = self._footage.get_or(place, lambda: Footage.read(self._lake, self._load(scenario_id), run, rollout))
            return read.picture(view)

        return self._seen.get_or((place, view), draw)

    def _load(self, scenario_id: str) -> ScenarioDescription:
        with self._lookup_lock:  # other requests of the same page wait for the lookup
            loader, index = self._locations.get(scenario_id) or self._locate(scenario_id)
        scenario: ScenarioDescription = loader[index]
        return scenario

    def _locate(self, scenario_id: str) -> tuple[ScenarioLoader, int]:
        """Locate a scenario together with the others on its page."""
        page = self._pages.get(scenario_id) or (scenario_id,)
        loader = ScenarioLoader(self._lake, page)
        for index, each in enumerate(page):
            self._locations.put(each, (loader, index))
        return loader, page.index(scenario_id)
