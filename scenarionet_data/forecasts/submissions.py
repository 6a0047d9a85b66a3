"""Submissions to the challenges of Argoverse 2 and Waymo, of predictions in a lake's frames."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.converters.formats.protobuf import bytes_field, number_field, varint
from scenarionet_data.errors import BadParameter
from scenarionet_data.forecasts.predictions import Prediction
from scenarionet_data.query.lake_view import LakeLike, open_view

_ARGOVERSE_DT, _ARGOVERSE_STEPS = 0.1, 60
_WAYMO_DT, _WAYMO_STEPS, _WAYMO_MODES = 0.5, 16, 6

# Field numbers of waymo_open_dataset/protos/motion_submission.proto.
_SCENARIOS, _TYPE, _ACCOUNT, _METHOD, _AUTHORS, _AFFILIATION, _DESCRIPTION, _LINK = range(1, 9)
_USES_LIDAR, _USES_CAMERA, _USES_PRETRAINING, _NUM_PARAMETERS = 9, 10, 11, 12
_SCENARIO_ID, _SINGLE, _PREDICTIONS = 1, 2, 1
_OBJECT_ID, _TRAJECTORIES = 1, 2
_TRAJECTORY, _CONFIDENCE = 1, 2
_CENTER_X, _CENTER_Y = 2, 3
_MOTION_PREDICTION = 1
_FLOAT = 5


@dataclass(frozen=True)
class WaymoEntry:
    """What a submission to Waymo's challenge says of itself.

    Attributes:
        account: E-mail address that is registered with Waymo.
        method: Short unique name.
        num_parameters: Estimate of the number of parameters, for example ``2M``.
        authors, affiliation, description, link: Of the method.
        uses_lidar, uses_camera, uses_public_pretraining: Data that the model uses.
    """

    account: str
    method: str
    num_parameters: str
    authors: tuple[str, ...] = ()
    affiliation: str = ""
    description: str = ""
    link: str = ""
    uses_lidar: bool = False
    uses_camera: bool = False
    uses_public_pretraining: bool = False


def write_argoverse2(lake: LakeLike, predictions: Sequence[Prediction], path: Path | str) -> None:
    """Write a submission to Argoverse 2's motion forecasting challenge (Parquet).

    Format: https://github.com/argoverse/av2-api, ``datasets/motion_forecasting/eval/submission.py``.

    Raises:
        BadParameter: A prediction is no 6 s at 10 Hz, or of a scenario that the lake does not have.
    """
    sources = _sources(lake, predictions)
    rows: dict[str, list[object]] = {
        name: []
        for name in ("scenario_id", "track_id", "probability", "predicted_trajectory_x", "predicted_trajectory_y")
    }
    for each in predictions:
        path_steps = _resampled(each, _ARGOVERSE_DT, _ARGOVERSE_STEPS)
        name, origin = sources[each.scenario_id]
        for mode, probability in zip(path_steps + origin, each.normalised, strict=True):
            values = (name, each.track_id, float(probability), mode[:, 0], mode[:, 1])
            for column, value in zip(rows.values(), values, strict=True):
                column.append(value)
    pq.write_table(pa.table(rows), path)


def write_waymo(lake: LakeLike, predictions: Sequence[Prediction], path: Path | str, entry: WaymoEntry) -> None:
    """Write a submission to Waymo's motion prediction challenge: a ``MotionChallengeSubmission`` message.

    Format: ``waymo_open_dataset/protos/motion_submission.proto`` and protobuf.dev/programming-guides/encoding.

    Raises:
        BadParameter: A prediction is no 8 s with positions every 0.5 s, has an id that is no number, or is of a
            scenario that the lake does not have.
    """
    sources = _sources(lake, predictions)
    with Path(path).open("wb") as file:
        for _, targets in groupby(predictions, key=lambda each: each.scenario_id):
            file.write(bytes_field(_SCENARIOS, b"".join(_scenario(list(targets), sources))))
        file.write(number_field(_TYPE, _MOTION_PREDICTION))
        texts = [(_ACCOUNT, entry.account), (_METHOD, entry.method), *((_AUTHORS, name) for name in entry.authors)]
        texts += [(_AFFILIATION, entry.affiliation), (_DESCRIPTION, entry.description), (_LINK, entry.link)]
        for number, text in texts:
            if text:
                file.write(bytes_field(number, text.encode()))
        for number, flag in (
            (_USES_LIDAR, entry.uses_lidar),
            (_USES_CAMERA, entry.uses_camera),
            (_USES_PRETRAINING, entry.uses_public_pretraining),
        ):
            file.write(number_field(number, int(flag)))
        file.write(bytes_field(_NUM_PARAMETERS, entry.num_parameters.encode()))


def _sources(lake: LakeLike, predictions: Sequence[Prediction]) -> dict[str, tuple[str, Float64]]:
    """Source id of each scenario, and (2,) origin [m] of its frame in the source's."""
    ids = sorted({each.scenario_id for each in predictions})
    rows = open_view(lake).find(ids)[1]
    return {
        row["scenario_id"]: (row["source_scenario_id"], np.array([row["origin_x"], row["origin_y"]])) for row in rows
    }


def _resampled(prediction: Prediction, dt: float, steps: int) -> Float64:
    """(K, steps, 2) positions at multiples of ``dt``."""
    stride = round(dt / prediction.dt)
    found = prediction.modes[:, stride - 1 :: stride] if stride > 0 else prediction.modes[:, :0]
    if abs(stride * prediction.dt - dt) > 1e-6 or found.shape[1] < steps:
        raise BadParameter(
            f"{prediction.track_id} of {prediction.scenario_id}: expected positions every {dt:g} s up to "
            f"{steps * dt:g} s, found {prediction.modes.shape[1]} every {prediction.dt:g} s: predict with "
            f"TimeWindow(future={steps * dt:g}, dt={dt:g})"
        )
    return found[:, :steps]


def _scenario(targets: Sequence[Prediction], sources: dict[str, tuple[str, Float64]]) -> Iterator[bytes]:
    """Fields of a ``ChallengeScenarioPredictions`` message."""
    name, origin = sources[targets[0].scenario_id]
    yield bytes_field(_SCENARIO_ID, name.encode())
    yield bytes_field(_SINGLE, b"".join(bytes_field(_PREDICTIONS, b"".join(_target(each, origin))) for each in targets))


def _target(prediction: Prediction, origin: Float64) -> Iterator[bytes]:
    """Fields of a ``SingleObjectPrediction`` message."""
    if not prediction.track_id.isdecimal():
        found = f"{prediction.track_id!r} of {prediction.scenario_id}"
        raise BadParameter(f"expected targets of Waymo scenarios, whose ids are numbers, found {found}")
    yield number_field(_OBJECT_ID, int(prediction.track_id))
    modes = _resampled(prediction, _WAYMO_DT, _WAYMO_STEPS)[:_WAYMO_MODES] + origin
    for mode, confidence in zip(modes.astype("<f4"), prediction.probabilities, strict=False):
        path = bytes_field(_CENTER_X, mode[:, 0].tobytes()) + bytes_field(_CENTER_Y, mode[:, 1].tobytes())
        scored = bytes_field(_TRAJECTORY, path) + varint(_CONFIDENCE << 3 | _FLOAT) + struct.pack("<f", confidence)
        yield bytes_field(_TRAJECTORIES, scored)
