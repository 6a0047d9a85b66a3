"""Near-duplicates: scenarios that show the same drive and traffic, moved, turned, noisier or a little later.

An embedding names the few candidates of each scenario; whether one is a duplicate is decided by the motion itself: both
are laid upon each other by the ego's poses, and the other road users have to be at the same places at the same times.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pyarrow as pa

from scenarionet_data.arrays.dtypes import Array, Bool, Float32, Float64, Int64
from scenarionet_data.arrays.geometry import wrap_angle
from scenarionet_data.databases.record import DatabaseRecord
from scenarionet_data.embeddings.search import embedding_of, vectors
from scenarionet_data.loader import ScenarioLoader
from scenarionet_data.operations.database_query import DatabaseQuery, several
from scenarionet_data.operations.overlap import DatabaseOverlap
from scenarionet_data.query.lake_view import LakeView
from scenarionet_data.scenario.description import ScenarioDescription

CANDIDATES = 5
"""Nearest scenarios of the first database that are compared with each of the second."""
_STEP = 0.5  # between the moments that are compared [s]
_OFFSETS = sorted((0.1 * tenths for tenths in range(-20, 21)), key=abs)  # by which one may begin later [s]
_EGO = 0.5  # mean distance between the paths of the egos, at most [m]
_OTHERS = 1.0  # mean distance between the paths of a road user, at most [m]
_SHARE = 0.7  # of the road users of the scenario with fewer of them that have to be found in the other
_MOMENTS = 4  # at which a road user is in both, at least; fewer say nothing
_FAR = 5.0  # an ego alone in both scenarios has to travel at least so far: all parked cars are alike [m]
_DOC = "Scenarios that show the same, also moved, turned, noisier, a little later, or without some road users."
_ROWS = 4096  # of the product of two sets of vectors that are in memory at a time


def embedding_overlap(view: LakeView, databases: tuple[DatabaseRecord | str, ...], name: str) -> list[DatabaseOverlap]:
    """Find the near-duplicates of databases, pair by pair; see :meth:`Lake.overlap <scenarionet_data.Lake.overlap>`."""
    embedding_of(view, name)
    records = [view.record(each) for each in several("overlap", databases)]
    found = []
    for first, second in combinations(records, 2):
        pairs = near_duplicates(DatabaseQuery.over(view, first, second, num_pinned=2).view, first, second, name)
        counts = len({one for one, _ in pairs}), len({other for _, other in pairs})
        examples = tuple((one, one, other) for one, other in pairs)
        found.append(DatabaseOverlap(first.reference, second.reference, "embedding", _DOC, *counts, examples))
    return found


def near_duplicates(view: LakeView, first: DatabaseRecord, second: DatabaseRecord, name: str) -> list[tuple[str, str]]:
    """Return the pairs of members of two databases that are near-duplicates, in order of their ids.

    Args:
        view: The lake, at a snapshot that has all members.
        first, second: The databases.
        name: The embedding.
    """
    ids = [database.members["scenario_id"].combine_chunks() for database in (first, second)]
    one, two = (vectors(view, name, each) for each in ids)
    rows, columns = _candidates(one, two)
    keys = [np.asarray(each.take(pa.array(place))) for each, place in zip(ids, (rows, columns), strict=True)]
    is_other = keys[0] != keys[1]
    pairs = sorted(set(zip(*(each[is_other].tolist() for each in keys), strict=True)))
    wanted = sorted({each for pair in pairs for each in pair})
    place = {each: number for number, each in enumerate(wanted)}
    motion = [_Motion(scenario) for scenario in ScenarioLoader(view, wanted)]
    return [(a, b) for a, b in pairs if is_duplicate(motion[place[a]], motion[place[b]])]


def _candidates(one: Float32, two: Float32) -> tuple[Int64, Int64]:
    """Rows of the nearest vectors of the first set for each of the second."""
    count = min(CANDIDATES + 1, len(one))  # one more, which may be the scenario itself
    lengths = np.einsum("ij,ij->i", one, one)
    found = []
    for start in range(0, len(two), _ROWS):
        away = lengths - 2 * two[start : start + _ROWS] @ one.T
        found.append(np.argpartition(away, count - 1, axis=1)[:, :count])
    return np.concatenate(found).ravel().astype(np.int64), np.repeat(np.arange(len(two)), count)


class _Motion:
    """What of a scenario is compared: times [s], and the ego's and the others' (N, T) states."""

    def __init__(self, scenario: ScenarioDescription) -> None:
        tracks, ego = scenario.tracks, scenario.ego_index
        others = np.arange(len(tracks)) != ego
        self.time, self.dt = scenario.timestamps, scenario.dt
        self.path, self.heading = tracks.position[ego, :, :2].astype(np.float64), tracks.heading[ego]
        self.is_there = tracks.valid[ego]
        self.others, self.valid = tracks.position[others, :, :2], tracks.valid[others]

    def at(self, times: Float64) -> tuple[Int64, Bool]:
        """Nearest timesteps of times, and whether the ego is there at them."""
        steps = np.clip(np.searchsorted(self.time, times - self.dt / 2), 0, len(self.time) - 1)
        return steps, (np.abs(self.time[steps] - times) < self.dt * 0.51) & self.is_there[steps]


def is_duplicate(one: _Motion, two: _Motion) -> bool:
    """Whether the second shows the same as the first, up to 2 s earlier or later, moved and turned."""
    times = np.arange(0.0, one.time[-1] + 1e-6, _STEP)
    return any(_is_same(one, two, times, offset) for offset in _OFFSETS)


def _is_same(one: _Motion, two: _Motion, times: Float64, offset: float) -> bool:
    (at, here), (then, there) = one.at(times), two.at(times + offset)
    both = here & there
    if both.sum() < max(_MOMENTS, len(times) / 2):
        return False
    at, then = at[both], then[both]
    turns = np.exp(1j * (one.heading[at].astype(np.float64) - two.heading[then]))
    angle = float(np.angle(turns.mean()))
    path, moved = one.path[at], _turned(two.path[then], angle)
    shift = (path - moved).mean(axis=0)
    bends = np.abs(wrap_angle(np.angle(turns) - angle)).mean()
    if np.hypot(*(path - moved - shift).T).mean() > _EGO or bends > 0.2:
        return False
    valid, other_valid = one.valid[:, at], two.valid[:, then]
    rows, columns = np.flatnonzero(valid.sum(1) >= _MOMENTS), np.flatnonzero(other_valid.sum(1) >= _MOMENTS)
    fewer = min(len(rows), len(columns))
    if fewer == 0:
        return len(rows) == len(columns) and float(np.hypot(*np.ptp(path, axis=0))) > _FAR
    places = one.others[rows][:, at]
    others = _turned(two.others[columns][:, then].astype(np.float64), angle) + shift
    shared = valid[rows][:, None] & other_valid[columns][None]
    apart = np.linalg.norm(places[:, None] - others[None], axis=-1)
    count = shared.sum(-1)
    mean = np.where(shared, apart, 0.0).sum(-1) / np.maximum(count, 1)
    is_found = ((mean < _OTHERS) & (count >= _MOMENTS)).any(axis=1)
    return bool(is_found.sum() >= _SHARE * fewer)


def _turned(points: Array, angle: float) -> Float64:
    """Points (..., 2) turned about the origin by an angle [rad]."""
    cosine, sine = np.cos(angle), np.sin(angle)
    turned: Float64 = points @ np.array([[cosine, sine], [-sine, cosine]])
    return turned
