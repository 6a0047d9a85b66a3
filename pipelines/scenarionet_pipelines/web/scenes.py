"""Cached scenarios for the browser: thumbnails, packed scenes and pictures of cameras by scenario id."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence
from functools import lru_cache
from itertools import islice
from typing import Any

from scenarionet_data import Lake, ScenarioLoader
from scenarionet_data.plots import thumbnail
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_pipelines.web.camera_views import CameraView, Footage
from scenarionet_pipelines.web.clips import stream_clip
from scenarionet_pipelines.web.packing import pack
from scenarionet_pipelines.web.runs import pack_run, runs_of

_MAX_LOCATIONS = 10_000
_MAX_LOADERS = 64
_MAX_THUMBNAILS = 4_000
_MAX_PACKED = 16
_MAX_FOOTAGE = 4
_MAX_SEEN = 500


class ScenarioCache:
    """Loads and caches scenarios of a lake.

    Locating scenarios among a million is slow, so it is done once per page of the table, when its first picture
    is requested, and on a separate connection, so that filters do not wait.

    Args:
        lake: The lake; its snapshot is read.
    """

    def __init__(self, lake: Lake) -> None:
        self._lake = Lake(lake.root, lake.snapshot.number, lake.user_columns)
        self._pages: dict[str, tuple[str, ...]] = {}
        self._loader = lru_cache(_MAX_LOADERS)(lambda page: ScenarioLoader(self._lake, page))
        self._lookup_lock = threading.Lock()
        self._thumbnail = lru_cache(_MAX_THUMBNAILS)(lambda scenario_id, size: thumbnail(self._load(scenario_id), size))
        self._packed = lru_cache(_MAX_PACKED)(lambda scenario_id: pack(self._load(scenario_id)))
        self._footage = lru_cache(_MAX_FOOTAGE)(
            lambda scenario_id, *of_run: Footage.read(self._lake, self._load(scenario_id), *of_run)
        )
        self._seen = lru_cache(_MAX_SEEN)(lambda view, *of_scenario: self._footage(*of_scenario).picture(view))

    def expect(self, scenario_ids: Sequence[str]) -> None:
        """Note that these scenarios are shown together: the first request locates all of them."""
        page = tuple(scenario_ids)
        self._pages |= dict.fromkeys(page, page)
        for forgotten in [*islice(self._pages, max(0, len(self._pages) - _MAX_LOCATIONS))]:
            del self._pages[forgotten]

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
        return self._thumbnail(scenario_id, size)

    def packed(self, scenario_id: str) -> bytes:
        """Return a scenario in the binary format of ``packing``.

        Raises:
            ScenarioNotFound: No scenario has that id.
        """
        return self._packed(scenario_id)

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
        return self._seen(view, scenario_id, run, rollout)

    def _load(self, scenario_id: str) -> ScenarioDescription:
        page = self._pages.get(scenario_id, (scenario_id,))
        with self._lookup_lock:  # other requests of the same page wait for the lookup
            loader = self._loader(page)
        scenario: ScenarioDescription = loader[page.index(scenario_id)]
        return scenario
