"""Read one nuScenes scene from its release's tables: keyframes, annotated objects, ego poses.

The rows of a scene are checked here. A row that cannot be used is dropped and reported; the scene is refused only if
its keyframes or the ego's path cannot be read.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Bool, Float64, Int64
from scenarionet_data.building.plausible import MAX_SPEED, find_bad_rows, find_jumps, find_repeated_rows
from scenarionet_data.converters.nuscenes.columns import UNKNOWN_BIT
from scenarionet_data.converters.nuscenes.keyframes import is_covered, nominal_period
from scenarionet_data.converters.nuscenes.tables import NuScenesRelease
from scenarionet_data.errors import InvalidScenario
from scenarionet_data.ingest.defects import Defect, Defects

_AROUND = 1e6
"""Time before the first keyframe and after the last from which ego poses are used [us]."""
_FIELDS = {"position": "translation", "heading": "rotation", "size": "size"}
"""Columns of the tables by the field at fault."""


@dataclass(frozen=True, eq=False)
class Objects:
    """N annotated objects of a scene with K keyframes.

    Attributes:
        tokens: (N,) str.
        categories: (N,) the source's categories; None if unknown.
        attributes: (N,) attributes of each object, with their numbers of keyframes.
        boxes: (N, K, 7) x, y, z [m], heading [rad], length, width, height [m]; 0 if not annotated.
        seen: (N, K) whether it is annotated.
    """

    tokens: Array
    categories: Array
    attributes: list[dict[str, int]]
    boxes: Float64
    seen: Bool


@dataclass(frozen=True, eq=False)
class NuScenesRecording:
    """One scene of K keyframes.

    Attributes:
        scene, log: Their records; the location of the log is None if unknown.
        samples: (K,) tokens of the keyframes.
        times: (K,) [us], strictly increasing.
        objects: The annotated objects.
        pose_times: (P,) [us], strictly increasing.
        poses: (P, 4) x, y, z [m], heading [rad] of the rear axle at ground level.
        defects: What was dropped or assumed.
    """

    scene: dict[str, Any]
    log: dict[str, Any]
    samples: Array
    times: Float64
    objects: Objects
    pose_times: Float64
    poses: Float64
    defects: tuple[Defect, ...]

    @property
    def name(self) -> str:
        """Name of the scene, for example ``scene-0061``."""
        return str(self.scene["name"])

    @property
    def num_rows(self) -> int:
        """Rows of annotations and poses that are used."""
        return int(self.objects.seen.sum()) + len(self.poses)


def read_recording(release: NuScenesRelease, token: str, scenario_id: str, folder: str) -> NuScenesRecording:
    """Read the scene of a token.

    Args:
        release: The tables.
        token: Token of the scene.
        scenario_id: For error messages.
        folder: Name of the release's folder, for reports.

    Raises:
        InvalidScenario: It has no usable keyframes or no path of the ego.
    """
    reader = _SceneReader(release, token, scenario_id, folder)
    samples, times, step = reader.keyframes()
    pose_times, poses = reader.path(times)
    objects = reader.objects(step, times, np.median(poses[:, :2], axis=0))
    return NuScenesRecording(
        scene=release.scenes[token],
        log=reader.log(),
        samples=samples,
        times=times,
        objects=objects,
        pose_times=pose_times,
        poses=poses,
        defects=reader.defects.found(),
    )


class _SceneReader:
    """Reads the rows of one scene, and collects their defects."""

    def __init__(self, release: NuScenesRelease, token: str, scenario_id: str, folder: str) -> None:
        self.defects = Defects()
        self._release = release
        self._number = list(release.scenes).index(token)
        self._scene = release.scenes[token]
        self._id = scenario_id
        self._folder = folder

    def log(self) -> dict[str, Any]:
        """The scene's log, with None for what is unknown."""
        token = self._scene["log_token"]
        log = self._release.logs.get(token)
        if log is None:
            reason = f"expected a log {token!r}, found none; the scenario has no map"
            self.defects.assume("maps", self._file("log"), [self._scene["token"]], "log_token", reason)
            return {"token": token or "", "logfile": None, "location": None, "date_captured": None}
        if log["location"] is None:
            reason = "expected the name of a location, found none; the scenario has no map"
            self.defects.assume("maps", self._file("log"), [token], "location", reason)
        return log

    def keyframes(self) -> tuple[Array, Float64, Int64]:
        """Tokens and times of the K usable keyframes, and the keyframe (or -1) of each row of the scene's samples."""
        rows = self._release.samples.of(self._number)
        times, wanted = rows["time"], self._scene["nbr_samples"]
        if wanted is not None and wanted != len(times):
            reason = f"expected {wanted} keyframes of the scene, found {len(times)}"
            self.defects.assume("tracks", self._file("sample"), [self._scene["token"]], "nbr_samples", reason)
        is_named = np.array([token is not None for token in rows["token"]], np.bool_)
        usable = rows["has_scene"] & is_named & np.isfinite(times)
        self._drop("sample", rows, ~rows["has_scene"], "scene_token", "expected a known scene, found none")
        self._drop("sample", rows, rows["has_scene"] & ~is_named, "token", "expected a text, found none")
        is_timeless = rows["has_scene"] & is_named & ~np.isfinite(times)
        self._drop("sample", rows, is_timeless, "timestamp", "expected microseconds, found no number")
        usable &= ~self._is_far(rows, usable)
        repeats = np.zeros(len(times), np.bool_)
        repeats[usable] = np.diff(times[usable], prepend=-np.inf) <= 0
        self._drop("sample", rows, repeats, "timestamp", "expected one keyframe at a time, found another")
        usable &= ~repeats
        if not usable.any():
            raise InvalidScenario(
                self._id, self._file("sample"), f"expected keyframes of scene {self._scene['name']}, found none"
            )
        step = np.where(usable, np.cumsum(usable) - 1, -1)
        return rows["token"][usable], times[usable], step

    def _is_far(self, rows: dict[str, Array], usable: Bool) -> Bool:
        """Keyframes further from the middle of the scene than the scene is long."""
        times = rows["time"]
        if usable.sum() < 3:
            return np.zeros(len(times), np.bool_)
        length = nominal_period(times[usable]) * 1e6 * usable.sum()
        is_far: Bool = usable & (np.abs(times - np.median(times[usable])) > length)
        found = f"{times[np.argmax(is_far)]:.0f}"
        expected = f"expected a time within {length * 1e-6:.0f} s of the scene's other keyframes"
        self._drop("sample", rows, is_far, "timestamp", f"{expected}, found {found}")
        return is_far

    def path(self, times: Float64) -> tuple[Float64, Float64]:
        """Times and poses of the ego; it is invalid at keyframes that they do not cover.

        Raises:
            InvalidScenario: There are none.
        """
        rows = self._sweeps()
        moments, poses, tokens = rows["time"], rows["pose"], rows["token"]

        def drop(is_bad: Array, field: str, reason: str) -> None:
            nonlocal moments, poses, tokens
            named = [token or "" for token in tokens[is_bad]]
            self.defects.drop("tracks", self._file("ego_pose"), named, field, reason)
            moments, poses, tokens = moments[~is_bad], poses[~is_bad], tokens[~is_bad]

        drop(np.isnan(moments), "timestamp", "expected a time and a pose for each lidar sweep, found none")
        is_off = np.not_equal(np.clip(moments, times[0] - _AROUND, times[-1] + _AROUND), moments)
        drop(np.asarray(is_off), "timestamp", "expected a time during the scene, found another")
        is_missing = np.asarray(~np.isfinite(poses).all(axis=1))
        drop(is_missing, "translation, rotation", "expected a position and a rotation, found none")
        if len(poses):
            faults = find_bad_rows(poses[:, :3], poses[:, 3], None, None, np.median(poses[:, :2], axis=0))
            for fault in faults[:1]:  # of finite poses only the position can be at fault
                drop(fault.mask, _FIELDS[fault.field], fault.reason)
        first = np.unique(moments, return_index=True)[1]
        moments, poses, tokens = moments[first], poses[first], tokens[first]
        is_jump = find_jumps(poses[None, :, :2], np.ones((1, len(moments)), np.bool_), moments * 1e-6)[0]
        drop(is_jump, "translation", _TOO_FAST)
        if not len(moments):
            wanted = f"expected ego poses at the lidar sweeps of scene {self._scene['name']}, found none"
            raise InvalidScenario(self._id, self._file("ego_pose"), wanted)
        if not is_covered(times, moments).all():
            reason = "expected ego poses from the first to the last keyframe, found fewer; the ego is not valid there"
            self.defects.assume("tracks", self._file("ego_pose"), [self._scene["token"]], "timestamp", reason)
        return moments, poses

    def _sweeps(self) -> dict[str, Array]:
        """Rows of the lidar's sweeps; of unknown sensors' if there are no others."""
        rows = self._release.poses.of(self._number)
        is_lidar = rows["is_lidar"]
        if is_lidar.all():
            return rows
        kept = is_lidar if is_lidar.any() else ~is_lidar
        what = "left out" if is_lidar.any() else "taken for the lidar's"
        reason = f"expected a known sensor, found none; {what}"
        tokens = [token or "" for token in rows["token"][~is_lidar]]
        self.defects.assume("tracks", self._file("sample_data"), tokens, "calibrated_sensor_token", reason)
        return {name: column[kept] for name, column in rows.items()}

    def objects(self, step: Int64, times: Float64, centre: Float64) -> Objects:
        """The annotated objects.

        Args:
            step: Keyframe of each row of the scene's samples, or -1.
            times: (K,) [us] of the keyframes.
            centre: (2,) [m] middle of the ego's path.
        """
        release = self._release
        rows = release.boxes.of(self._number)
        stated = np.bincount(rows["instance"][rows["instance"] >= 0], minlength=len(release.instances["token"]))
        number = rows["sample"] - self._release.samples.start[self._number]
        is_inside = (number >= 0) & (number < len(step))
        place = np.append(step, -1)[np.where(is_inside, number, -1)]
        good = np.ones(len(place), np.bool_)

        def drop(mask: Bool, field: str, reason: str) -> None:
            self._drop("sample_annotation", rows, mask & good, field, reason)
            good[mask] = False

        drop(rows["sample"] < 0, "sample_token", "expected a known keyframe, found none")
        drop(place < 0, "sample_token", "expected a keyframe of the scene that can be used, found another")
        drop(rows["instance"] < 0, "instance_token", "expected a known object, found none")
        box = rows["box"]
        for bad in find_bad_rows(box[:, :3], box[:, 3], None, box[:, 4:], centre):
            drop(bad.mask, _FIELDS[bad.field], bad.reason)
        repeated = find_repeated_rows(rows["instance"], place, good)
        if repeated is not None:
            drop(repeated.mask, "sample_token", "expected one row for an object and keyframe, found another")
        which, row = np.unique(rows["instance"][good], return_inverse=True)
        boxes, source = np.zeros((len(which), len(times), 7)), np.full((len(which), len(times)), -1)
        boxes[row, place[good]], source[row, place[good]] = box[good], np.flatnonzero(good)
        is_jump = find_jumps(boxes[..., :2], source >= 0, times * 1e-6)
        if is_jump.any():
            mask = np.zeros(len(good), np.bool_)
            mask[source[is_jump]] = True
            drop(mask, "translation", _TOO_FAST)
            boxes[is_jump], source[is_jump] = 0.0, -1
        return self._described(rows, which, boxes, source, stated)

    def _described(self, rows: dict[str, Array], which: Int64, boxes: Float64, source: Int64, stated: Int64) -> Objects:
        """Objects from their boxes and the row (N, K) of each; ``stated`` is the number of rows that name an object."""
        kept = (source >= 0).any(axis=1)
        which, boxes, source = which[kept], boxes[kept], source[kept]
        row, step = np.nonzero(source >= 0)
        bits = rows["attributes"][source[row, step]]
        is_unknown = (bits >> np.uint64(UNKNOWN_BIT)).astype(np.bool_)
        reason = "expected known attributes, found another; left out"
        numbers = rows["row"][source[row, step]][is_unknown].tolist()
        self.defects.assume("tracks", self._file("sample_annotation"), numbers, "attribute_tokens", reason)
        tokens, categories, count = (self._release.instances[name][which] for name in ("token", "category", "count"))
        is_unnamed = np.array([category is None for category in categories], np.bool_)
        reason = "expected a known category, found none; the type is OTHER"
        self.defects.assume("tracks", self._file("instance"), tokens[is_unnamed].tolist(), "category_token", reason)
        is_short = count != stated[which]
        if is_short.any():
            first = np.argmax(is_short)
            reason = f"expected {count[first]} annotations, found {stated[which][first]}; their number is not used"
            self.defects.assume("tracks", self._file("instance"), tokens[is_short].tolist(), "nbr_annotations", reason)
        shifts = np.arange(len(self._release.attributes), dtype=np.uint64)
        counts = np.zeros((len(which), len(self._release.attributes)), np.int64)
        np.add.at(counts, row, ((bits[:, None] >> shifts) & np.uint64(1)).astype(np.int64))
        attributes = [{self._release.attributes[k]: n for k, n in enumerate(line) if n} for line in counts.tolist()]
        return Objects(tokens, categories, attributes, boxes, source >= 0)

    def _drop(self, table: str, rows: dict[str, Array], mask: Bool, field: str, reason: str) -> None:
        self.defects.drop("tracks", self._file(table), rows["row"][mask].tolist(), field, reason)

    def _file(self, table: str) -> str:
        return f"{self._folder}/{table}.json"


_TOO_FAST = f"expected less than {MAX_SPEED:.0f} m/s from and to the neighbouring positions, found more"
