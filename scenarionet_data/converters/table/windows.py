"""Cut a recording of tracks into windows, each seen from one of its vehicles."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import isfinite

import numpy as np

from scenarionet_data.building import StateGrid, make_origin, make_tracks
from scenarionet_data.converters.cities import CityMap
from scenarionet_data.converters.table.rows import FrameClock, TrackRows
from scenarionet_data.errors import BadParameter, CorruptSource, InvalidScenario
from scenarionet_data.ingest.defects import Defects
from scenarionet_data.ingest.options import Options, option
from scenarionet_data.ingest.shard import Shard
from scenarionet_data.scenario.description import Lights, ScenarioDescription, Source, make_scenario_id
from scenarionet_data.scenario.vocabulary import ObjectType

_MARGIN = 100.0
"""Margin of the map around all road users [m]."""


@dataclass(frozen=True)
class WindowOptions(Options):
    """Windows and egos."""

    window: float = option(20.0, "Length of a scenario [s].")
    stride: float = option(0.0, "Time between the starts of two windows [s]; 0: the window.")
    ego: str = option(
        "longest",
        "longest: the vehicle seen longest in a window; each: a scenario for each vehicle; or the id of a track.",
    )
    every: int = option(1, "With ego=each: take every n-th vehicle of a window.")
    seen: float = option(4.0, "With ego=each: vehicles seen for at least this time [s].")
    history: float = option(1.0, "Time before the current timestep [s], at which the ego is there.", is_added=True)

    def __post_init__(self) -> None:
        lengths = (self.window, self.stride, self.history)
        if not (all(map(isfinite, lengths)) and self.window > 0 and self.stride >= 0 and self.history >= 0):
            raise BadParameter(f"window, stride, history: expected seconds, found {', '.join(map(str, lengths))}")
        if self.every < 1 or not self.seen >= 0:
            raise BadParameter(f"every, seen: expected 1 and 0 s or more, found {self.every} and {self.seen}")


@dataclass(frozen=True, eq=False)
class TrackWindow:
    """Frames ``first`` to ``last - 1`` of a recording, seen from one vehicle: one scenario.

    Attributes:
        rows: TrackRows of the window, sorted by track and frame.
        ego: Number of the ego in ``rows.ids``; None if there is none.
        defects: Rows that were dropped; those of a recording are told with its first window.
    """

    rows: TrackRows
    clock: FrameClock
    first: int
    last: int
    ego: int | None
    defects: Defects

    @property
    def moment_ms(self) -> int:
        """Time of its first frame on the source's clock [ms]."""
        return round(self.clock.moment(self.first) * 1000.0)


def cut(rows: TrackRows, clock: FrameClock, options: WindowOptions, defects: Defects) -> Iterator[TrackWindow]:
    """Cut a recording every ``stride`` seconds into ``window`` seconds.

    What remains at the end joins the last window if it would end within its history: no row is left out.

    Raises:
        CorruptSource: A window or stride is shorter than a timestep of the recording.
    """
    size, step = (round(seconds / clock.step) for seconds in (options.window, options.stride or options.window))
    if min(size, step) < 1:
        found = f"found {options.window} and {options.stride}"
        raise CorruptSource(f"window, stride: expected {clock.step:g} s or more (or a stride of 0), {found}")
    start, end = int(rows.frame.min()), int(rows.frame.max()) + 1
    history = round(options.history / clock.step)
    for first in range(start, end, step):
        last = first + size if first + size + history < end else end
        window = rows.take((rows.frame >= first) & (rows.frame < last))
        for ego in _egos(window, clock.step, options) if len(window.line) else ():
            yield TrackWindow(window, clock, first, last, ego, defects)
            defects = Defects()
        if last == end:
            return


def _egos(rows: TrackRows, step: float, options: WindowOptions) -> list[int | None]:
    """Numbers of the vehicles that are egos; None if there is none."""
    counts = np.bincount(rows.track, minlength=len(rows.ids))
    is_vehicle = rows.kinds == ObjectType.VEHICLE
    if options.ego == "longest":
        return [int(np.where(is_vehicle, counts, 0).argmax()) if is_vehicle.any() else None]
    if options.ego == "each":
        chosen = np.flatnonzero(is_vehicle & (counts * step >= options.seen))
        return [int(row) for row in chosen[:: options.every]]
    return [int(row) for row in np.flatnonzero(rows.ids == options.ego)] or [None]


def describe(
    shard: Shard, window: TrackWindow, source: Source, city: CityMap | None, map_id: str | None, has_z: bool = False
) -> ScenarioDescription:
    """Make the scenario of a window.

    Args:
        shard: The shard, with ``WindowOptions``.
        window: The window.
        source: Where it is from; the id is made of its log.
        city: The map of the place; None for scenarios without one.
        map_id: Its name.
        has_z: Whether heights are recorded.
    """
    options, log, rows = shard.options_as(WindowOptions), str(source.log), window.rows
    if window.ego is None:
        where = make_scenario_id(shard.dataset, shard.version, log, window.moment_ms)
        expected = "a vehicle" if options.ego in ("longest", "each") else f"the track {options.ego}"
        raise InvalidScenario(where, "ego_id", f"expected {expected} in the window, found none")
    times = window.clock.timestamps(window.first, window.last)
    grid = StateGrid(rows.track, rows.frame - window.first, (len(rows.ids), len(times)))
    seen = grid.valid[window.ego]
    position = grid.place(np.column_stack([rows.position, rows.height]))
    origin = make_origin(position[window.ego], seen, has_z=has_z)
    roads, crop = city.around(rows.position, _MARGIN, origin, has_z) if city else (None, None)
    steps = np.flatnonzero(seen)
    later = steps[steps >= min(round(options.history / window.clock.step), len(times) - 1)]
    name = f"{log}-{rows.ids[window.ego]}" if options.ego == "each" else log
    return ScenarioDescription(
        id=make_scenario_id(shard.dataset, shard.version, name, window.moment_ms),
        dataset=shard.dataset,
        version=shard.version,
        split=shard.split,
        timestamps=times,
        dt=window.clock.step,
        current_timestep=int(later[0] if len(later) else steps[-1]),  # after the history, or else before
        ego_id=rows.ids[window.ego],
        origin=origin,
        has_z=has_z,
        source=source,
        tracks=make_tracks(
            list(rows.ids),
            rows.kinds,
            position,
            grid.place(rows.heading),
            grid.place(rows.velocity),
            grid.place(rows.size),
            grid.valid,
            origin=origin,
            source_type=list(rows.words),
            is_size_assumed=~rows.has_sizes,
            is_type_assumed=~rows.has_types,
            is_velocity_estimated=~rows.has_velocities,
        ),
        lights=Lights.empty(len(times)),
        map=roads,
        map_id=map_id if city else None,
        map_crop=crop,
        extras={"start_timestamp_ms": window.moment_ms},
        defects=window.defects.found(),
    )
