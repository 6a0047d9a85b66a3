"""Build tracks of Lyft's agents and of the recording vehicle, which is not among them."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import replace

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float32, Float64
from scenarionet_data.arrays.geometry import estimate_velocity
from scenarionet_data.building import StateGrid, make_tracks
from scenarionet_data.building.plausible import find_bad_rows, find_dead_ends, find_repeated_rows
from scenarionet_data.converters.lyft.recording import LyftContent, is_text
from scenarionet_data.ingest.defects import Defects
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
_FIELDS = {"position": "centroid", "heading": "yaw", "velocity": "velocity", "size": "extent"}
"""Names in the agents' records."""
_UNTOLD = frozenset(
    {*(f"PERCEPTION_LABEL_{word}" for word in ("NOT_SET", "UNKNOWN", "DONTCARE")), "AVRESEARCH_LABEL_DONTCARE"}
)


def drop_bad_rows(content: LyftContent, file: str, defects: Defects) -> LyftContent:
    """Return the content without agents and faces that cannot be used.

    Args:
        content: T frames.
        file: The recording.
        defects: The dropped rows are added to it.
    """
    agents = content.agents
    position = np.pad(agents["centroid"], ((0, 0), (0, 1))).astype(np.float64)
    found = find_bad_rows(position, agents["yaw"], agents["velocity"], agents["extent"], content.ego[content.frame, :2])
    is_good = np.ones(len(agents), np.bool_)
    for bad in found:
        rows = content.agents_row[bad.mask].tolist()
        defects.drop("tracks", f"{file}/agents", rows, _FIELDS[bad.field], bad.reason)
        is_good &= ~bad.mask
    (kept,) = np.nonzero(is_good)
    repeated = find_repeated_rows(agents["track_id"][kept], content.frame[kept])
    if repeated:
        rows = content.agents_row[kept[repeated.mask]].tolist()
        defects.drop("tracks", f"{file}/agents", rows, "track_id", repeated.reason)
        kept = kept[~repeated.mask]
    is_told = np.isfinite(agents["label_probabilities"]).all(axis=1)
    rows = content.agents_row[is_good & ~is_told].tolist()
    defects.assume("tracks", f"{file}/agents", rows, "label_probabilities", "expected probabilities, found NaN")
    faces = content.faces
    is_named = np.ones(len(faces), np.bool_)
    if len(faces):
        is_named = is_text(faces["face_id"]) & is_text(faces["traffic_light_id"])
        rows = content.faces_row[~is_named].tolist()
        defects.drop("lights", f"{file}/traffic_light_faces", rows, "face_id", "expected text, found other bytes")
    return replace(
        content,
        frame=content.frame[kept],
        agents=agents[kept],
        agents_row=content.agents_row[kept],
        faces_frame=content.faces_frame[is_named],
        faces=faces[is_named],
        faces_row=content.faces_row[is_named],
    )


def tracks(
    content: LyftContent, has_ego: Bool, is_filled: Bool, labels: Sequence[str], origin: Float64, keep_unknown: bool
) -> tuple[Tracks, int]:
    """Build the agents followed by the ego; return the number of repaired velocities as well.

    A track has its most probable label over all frames. The source has a velocity of exactly zero where it has no
    estimate, even for moving road users; their velocity is estimated from positions.

    Args:
        content: T frames, without unusable rows.
        has_ego: (T,) whether the ego's pose is known or interpolated.
        is_filled: (T,) whether it is interpolated.
        labels: Names of the labels.
        origin: (3,) [m].
        keep_unknown: Whether to keep objects of unknown type.
    """
    rows = _Rows(content, labels)
    if not keep_unknown:
        rows = rows.known()
    times = (content.times - content.times[0]) * 1e-9
    kinds = np.array([_TYPES.get(word, ObjectType.OTHER) for word in rows.words], np.uint8)
    velocity, is_repaired = _repaired(rows, np.isin(kinds, list(_GROUPS)), times)
    agents, ego, count = rows.agents, content.ego[has_ego], len(rows.ids)
    track = np.concatenate([rows.track, np.full(len(ego), count)])
    grid = StateGrid(track, np.concatenate([rows.frame, np.flatnonzero(has_ego)]), (count + 1, len(times)))
    ego_velocity = estimate_velocity(content.ego[None, :, :2], has_ego[None], times)[0, has_ego]
    place = grid.place(np.concatenate([agents["centroid"], ego[:, :2]]))
    motion = grid.place(np.concatenate([velocity, ego_velocity]))
    dead, step, near = find_dead_ends(place, motion, grid.valid, times)
    motion[dead, step] = motion[dead, near]
    is_estimated = np.append(np.bincount(rows.track, is_repaired, count) > 0, True)
    is_estimated[dead] = True
    made = make_tracks(
        [*map(str, rows.ids.tolist()), EGO],
        [*kinds, ObjectType.VEHICLE],
        np.pad(place, ((0, 0), (0, 0), (0, 1))),
        grid.place(np.concatenate([agents["yaw"], ego[:, 2]])),
        motion,
        grid.place(np.concatenate([agents["extent"], np.tile(np.array(EGO_SIZE, np.float32), (len(ego), 1))])),
        grid.valid,
        origin=origin,
        source_type=[*rows.words, "EGO"],
        is_size_assumed=[False] * count + [True],
        is_type_assumed=[*rows.is_word_varied.tolist(), False],
        is_velocity_estimated=is_estimated,
        is_interpolated=grid.place(np.concatenate([np.zeros(len(rows.track), np.bool_), is_filled[has_ego]])),
    )
    return made, int(is_repaired.sum()) + len(dead)


class _Rows:
    """R rows of N tracks, sorted by track and time.

    Attributes:
        agents, frame: (R,) records, and the timestep of each.
        ids: (N,) ascending.
        track: (R,) row of ``ids``, ascending.
        words: (N,) labels.
        is_word_varied: (N,) whether the label varies over a track's frames.
    """

    def __init__(self, content: LyftContent, labels: Sequence[str]) -> None:
        order = np.lexsort((content.frame, content.agents["track_id"]))
        self.agents, self.frame = content.agents[order], content.frame[order]
        self.ids, first, self.track = np.unique(self.agents["track_id"], return_index=True, return_inverse=True)
        probabilities = np.nan_to_num(self.agents["label_probabilities"], posinf=0.0, neginf=0.0).clip(0.0, 1.0)
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
