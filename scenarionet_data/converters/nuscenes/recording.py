"""Read one nuScenes scene from its release's tables: keyframes, annotated objects, ego poses.

The consistency of a scene's rows is checked here, so that missing, duplicate or invalid rows affect their scene only.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Bool, Float64
from scenarionet_data.converters.nuscenes.columns import UNKNOWN_BIT
from scenarionet_data.converters.nuscenes.tables import NuScenesRelease
from scenarionet_data.errors import InvalidScenario

_REACH = 1e5
"""Tolerated time from the first keyframe to the first ego pose, and from the last pose to the last keyframe [us]."""

TableCheck = Callable[[bool | np.bool_, str, str], None]
"""Called with whether a rule is met, its table, and the expectation."""


@dataclass(frozen=True, eq=False)
class Objects:
    """N annotated objects of a scene with K keyframes.

    Attributes:
        tokens: (N,) str.
        categories: (N,) the source's categories.
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
        scene, log: Their records.
        samples: (K,) tokens of the keyframes.
        times: (K,) [us], strictly increasing.
        objects: The annotated objects.
        pose_times: (P,) [us], strictly increasing.
        poses: (P, 4) x, y, z [m], heading [rad] of the rear axle at ground level.
    """

    scene: dict[str, Any]
    log: dict[str, Any]
    samples: Array
    times: Float64
    objects: Objects
    pose_times: Float64
    poses: Float64

    @property
    def name(self) -> str:
        """Name of the scene, for example ``scene-0061``."""
        return str(self.scene["name"])


def read_recording(release: NuScenesRelease, token: str, scenario_id: str) -> NuScenesRecording:
    """Read the scene of a token.

    Raises:
        InvalidScenario: Its rows are inconsistent.
    """

    def check(is_met: bool | np.bool_, table: str, reason: str) -> None:
        if not is_met:
            raise InvalidScenario(scenario_id, table, reason)

    number, scene = list(release.scenes).index(token), release.scenes[token]
    samples = release.samples.of(number)
    times, wanted = samples["time"], scene["nbr_samples"]
    check(scene["log_token"] in release.logs, "log", f"expected a log {scene['log_token']!r}, found none")
    check(len(times) == wanted > 0, "sample", f"expected {wanted} of the scene, found {len(times)}")
    check(np.isfinite(times).all() and (np.diff(times) > 0).all(), "sample", "expected strictly increasing times")
    pose_times, poses = _path(release.poses.of(number), times, check)
    return NuScenesRecording(
        scene=scene,
        log=release.logs[scene["log_token"]],
        samples=samples["token"],
        times=times,
        objects=_objects(release, number, len(times), check),
        pose_times=pose_times,
        poses=poses,
    )


def _path(rows: dict[str, Array], times: Float64, check: TableCheck) -> tuple[Float64, Float64]:
    """Times and poses of the ego."""
    is_known = np.isfinite(rows["time"]) & np.isfinite(rows["pose"]).all(axis=1)
    check(is_known.all(), "ego_pose", "expected a finite pose for every lidar sweep")
    moments, first = np.unique(rows["time"], return_index=True)
    is_covered = len(moments) > 0 and moments[0] <= times[0] + _REACH and moments[-1] >= times[-1] - _REACH
    check(is_covered, "sample_data", "expected lidar sweeps from the first to the last keyframe")
    return moments, rows["pose"][first]


def _objects(release: NuScenesRelease, number: int, num_keyframes: int, check: TableCheck) -> Objects:
    rows = release.boxes.of(number)
    table = "sample_annotation"
    check((rows["instance"] >= 0).all(), table, "expected a known instance_token in every row")
    check(np.isfinite(rows["box"]).all(), table, "expected finite numbers and rotations of length 1")
    check((rows["box"][:, 4:] > 0).all(), table, "expected sizes above 0")
    check(not (rows["attributes"] >> np.uint64(UNKNOWN_BIT)).any(), table, "expected known attribute_tokens")
    which, row = np.unique(rows["instance"], return_inverse=True)
    step = rows["sample"] - release.samples.start[number]
    boxes = np.zeros((len(which), num_keyframes, 7))
    boxes[row, step] = rows["box"]
    seen = np.zeros(boxes.shape[:2], np.bool_)
    seen[row, step] = True
    check(seen.sum() == len(row), table, "expected one row for each instance and sample, found two")
    tokens, categories, count = (release.instances[name][which] for name in ("token", "category", "count"))
    is_whole = seen.sum(axis=1) == count
    check(is_whole.all(), table, f"expected nbr_annotations rows of every instance, not so {tokens[~is_whole][:1]}")
    check(None not in categories, "instance", "expected a known category_token")
    return Objects(
        tokens, categories, _attributes(rows["attributes"], row, len(which), release.attributes), boxes, seen
    )


def _attributes(bits: Array, row: Array, num_objects: int, words: list[str]) -> list[dict[str, int]]:
    """Number of rows of each object with each bit."""
    shifts = np.arange(len(words), dtype=np.uint64)
    counts = np.zeros((num_objects, len(words)), np.int64)
    np.add.at(counts, row, ((bits[:, None] >> shifts) & np.uint64(1)).astype(np.int64))
    return [{words[k]: n for k, n in enumerate(line) if n} for line in counts.tolist()]
