"""Build tracks of Lyft's agents and of the recording vehicle, which is not among them."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float32, Float64
from scenarionet_data.arrays.geometry import estimate_velocity
from scenarionet_data.building import make_tracks_of_rows
from scenarionet_data.converters.lyft.recording import LyftContent
from scenarionet_data.errors import InvalidScenario
from scenarionet_data.scenario.description import Tracks
from scenarionet_data.scenario.vocabulary import ObjectType

EGO = "ego"
EGO_SIZE = (4.87, 1.85, 1.8)
"""Length, width, height [m] of the recording vehicle with sensors, as assumed in l5kit
(``l5kit/rasterization/rasterizer.py``)."""

MOVING = 1.0
"""Speed from which a road user with a recorded velocity of zero is considered moving [m/s]."""
_REACH = 4
"""Frames on either side used to estimate its velocity: boxes jump by decimetres between frames, especially at the
start of a track, where recorded velocities are zero."""

# A riderless bicycle or motorcycle is not a cyclist: the dataset has separate labels for riders.
_GROUPS = {
    ObjectType.VEHICLE: "CAR VAN TRAM BUS TRUCK EMERGENCY_VEHICLE OTHER_VEHICLE",
    ObjectType.CYCLIST: "CYCLIST MOTORCYCLIST",
    ObjectType.PEDESTRIAN: "PEDESTRIAN",
}
_TYPES = {f"PERCEPTION_LABEL_{word}": kind for kind, words in _GROUPS.items() for word in words.split()}
_UNTOLD = frozenset(
    {*(f"PERCEPTION_LABEL_{word}" for word in ("NOT_SET", "UNKNOWN", "DONTCARE")), "AVRESEARCH_LABEL_DONTCARE"}
)


def tracks(
    content: LyftContent, labels: Sequence[str], origin: Float64, where: str, keep_unknown: bool
) -> tuple[Tracks, int]:
    """Build the agents followed by the ego; return the number of repaired velocities as well.

    A track has its most probable label over all frames. The source has a velocity of exactly zero where it has no
    estimate, even for moving road users; their velocity is estimated from positions.

    Args:
        content: T frames.
        labels: Names of the labels.
        origin: (3,) [m].
        where: Name of the scenario in errors.
        keep_unknown: Whether to keep objects of unknown type.

    Raises:
        InvalidScenario: A track has two rows in one frame.
    """
    rows = _Rows(content, labels, where)
    if not keep_unknown:
        rows = rows.known()
    times = (content.times - content.times[0]) * 1e-9
    kinds = np.array([_TYPES.get(word, ObjectType.OTHER) for word in rows.words], np.uint8)
    velocity, is_repaired = _repaired(rows, np.isin(kinds, list(_GROUPS)), times)
    agents, ego, count, steps = rows.agents, content.ego, len(rows.ids), len(times)
    ego_velocity = estimate_velocity(ego[None, :, :2], np.ones((1, steps), np.bool_), times)[0]
    made = make_tracks_of_rows(
        [*map(str, rows.ids.tolist()), EGO],
        [*kinds, ObjectType.VEHICLE],
        np.pad(np.concatenate([agents["centroid"], ego[:, :2]]), ((0, 0), (0, 1))),
        np.concatenate([agents["yaw"], ego[:, 2]]),
        np.concatenate([velocity, ego_velocity]),
        np.concatenate([agents["extent"], np.tile(np.array(EGO_SIZE, np.float32), (steps, 1))]),
        np.concatenate([rows.track, np.full(steps, count)]),
        np.concatenate([rows.frame, np.arange(steps)]),
        steps,
        origin=origin,
        source_type=[*rows.words, "EGO"],
        is_size_assumed=[False] * count + [True],
        is_type_assumed=[*rows.is_word_varied.tolist(), False],
        is_velocity_estimated=[*(np.bincount(rows.track, is_repaired, count) > 0).tolist(), True],
    )
    return made, int(is_repaired.sum())


class _Rows:
    """R rows of N tracks, sorted by track and time.

    Attributes:
        agents, frame: (R,) records, and the timestep of each.
        ids: (N,) ascending.
        track: (R,) row of ``ids``, ascending.
        words: (N,) labels.
        is_word_varied: (N,) whether the label varies over a track's frames.
    """

    def __init__(self, content: LyftContent, labels: Sequence[str], where: str) -> None:
        order = np.lexsort((content.frame, content.agents["track_id"]))
        self.agents, self.frame = content.agents[order], content.frame[order]
        self.ids, first, self.track = np.unique(self.agents["track_id"], return_index=True, return_inverse=True)
        (twice,) = np.nonzero((np.diff(self.track) == 0) & (np.diff(self.frame) == 0))
        if len(twice):
            found = f"found more of track {self.agents['track_id'][twice[0]]} at timestep {self.frame[twice[0]]}"
            raise InvalidScenario(where, "agents.track_id", f"expected one row per track and frame, {found}")
        probabilities = self.agents["label_probabilities"]
        total = np.add.reduceat(probabilities, first, axis=0) if len(first) else np.zeros((0, len(labels)))
        label = total.argmax(axis=1)
        differs = probabilities.argmax(axis=1) != label[self.track]
        self.words = [labels[number] for number in label.tolist()]
        self.is_word_varied = np.bincount(self.track, differs, len(self.ids)) > 0

    def known(self) -> _Rows:
        """Rows of objects of known type."""
        is_told = ~np.isin(self.words, list(_UNTOLD))
        rows, chosen = is_told[self.track], copy(self)
        chosen.agents, chosen.frame = self.agents[rows], self.frame[rows]
        chosen.track = (np.cumsum(is_told) - 1)[self.track[rows]]
        chosen.ids, chosen.is_word_varied = self.ids[is_told], self.is_word_varied[is_told]
        chosen.words = [word for word, told in zip(self.words, is_told, strict=True) if told]
        return chosen


def _repaired(rows: _Rows, is_road_user: Bool, times: Float64) -> tuple[Float32, Bool]:
    """Velocities (R, 2), and whether each is estimated: for road users (N,) that move at exactly 0 m/s.

    Estimated over ``_REACH`` timesteps on either side, fewer at the ends of an uninterrupted observation.
    """
    velocity = rows.agents["velocity"].astype(np.float32)
    here = np.arange(len(velocity))
    begins = np.ones(len(velocity), np.bool_)
    begins[1:] = (np.diff(rows.track) > 0) | (np.diff(rows.frame) > 1)
    run = np.cumsum(begins) - 1
    first, length = np.flatnonzero(begins), np.bincount(run)
    (still,) = np.nonzero(~velocity.any(axis=1) & is_road_user[rows.track])
    before = np.maximum(here - _REACH, first[run])[still]
    after = np.minimum(here + _REACH, (first + length - 1)[run])[still]
    move = (rows.agents["centroid"][after] - rows.agents["centroid"][before]).astype(np.float64)
    span = (times[rows.frame[after]] - times[rows.frame[before]])[:, None]
    estimated = np.divide(move, span, out=np.zeros_like(move), where=span > 0)
    is_moving = np.hypot(*estimated.T) > MOVING
    velocity[still[is_moving]] = estimated[is_moving]
    is_repaired = np.zeros(len(velocity), np.bool_)
    is_repaired[still[is_moving]] = True
    return velocity, is_repaired
