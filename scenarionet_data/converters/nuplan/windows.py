"""Cut a nuPlan log into scenarios: scenes, or windows around scenario tags."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Int64
from scenarionet_data.converters.nuplan.log import SWEEP, NuPlanLog


@dataclass(frozen=True, eq=False)
class NuPlanWindow:
    """The sweeps of one scenario.

    Attributes:
        sweeps: (T,) int64 rows of the log's sweeps, increasing; empty for a tag of a missing sweep, or a scene without
            usable sweeps.
        current: Index of the last sweep of the history.
        token: Token of the scene, or of the tag's sweep.
        tags: Types of the tags of that sweep, or of all sweeps of the scene.
        tracks: Tracks concerned by the tags of a tag's sweep.
    """

    sweeps: Int64
    current: int
    token: str
    tags: tuple[str, ...]
    tracks: tuple[str, ...] = ()


def scenes(log: NuPlanLog, stride: int, past: float) -> Iterator[NuPlanWindow]:
    """Yield the scenes sorted by time, with every ``stride``-th sweep and ``past`` seconds of history."""
    sweep_of = {token: row for row, token in enumerate(log.tokens)}
    tagged = [(sweep_of[tag.sweep], tag.type) for tag in log.tags if tag.sweep in sweep_of]
    types: dict[int, set[str]] = {}
    for sweep, kind in tagged:
        types.setdefault(int(log.scene[sweep]), set()).add(kind)
    for row, scene in enumerate(log.scenes):
        sweeps = np.flatnonzero(log.scene == row)[::stride]
        current = _last_before(log, sweeps, past) if len(sweeps) else 0
        yield NuPlanWindow(sweeps, current, scene.token, tuple(sorted(types.get(row, ()))))


def _last_before(log: NuPlanLog, sweeps: Int64, past: float) -> int:
    """Position of the last sweep not later than ``past`` seconds after the first."""
    times = log.times[sweeps]
    return int(np.searchsorted(times, times[0] + past * 1e6 + SWEEP / 2, side="right")) - 1


def tag_windows(
    log: NuPlanLog, stride: int, past: float, future: float, wanted: Collection[str]
) -> Iterator[NuPlanWindow]:
    """Yield a window around every tagged sweep, sorted by time, from ``past`` to ``future`` seconds.

    The tags of one sweep share a window. Windows are shorter at the ends of the log.

    Args:
        log: The log.
        stride: Take every ``stride``-th sweep, counted from the tagged one.
        past, future: Seconds.
        wanted: Types of tags; all if empty.
    """
    sweep_of = {token: row for row, token in enumerate(log.tokens)}
    by_sweep: dict[str, list[tuple[str, str]]] = {}
    for tag in log.tags:
        if not wanted or tag.type in wanted:
            by_sweep.setdefault(tag.sweep, []).append((tag.type, tag.track))
    for token, tags in by_sweep.items():
        types = tuple(dict.fromkeys(kind for kind, _ in tags))
        tracks = tuple(dict.fromkeys(track for _, track in tags if track))
        here = sweep_of.get(token)
        if here is None:
            yield NuPlanWindow(np.zeros(0, np.int64), 0, token, types, tracks)
            continue
        bounds = [log.times[here] - past * 1e6 - SWEEP / 2, log.times[here] + future * 1e6 + SWEEP / 2]
        first, last = np.searchsorted(log.times, bounds)
        before = np.arange(here, first - 1, -stride)[::-1]
        sweeps = np.concatenate([before, np.arange(here + stride, last, stride)])
        yield NuPlanWindow(sweeps, len(before) - 1, token, types, tracks)
