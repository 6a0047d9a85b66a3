"""Predictions: trajectories of targets with probabilities, as rows of ``schemas/predictions.toml``."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from scenarionet_data.arrays.dtypes import Array, Float64, IntP
from scenarionet_data.arrays.geometry import rotate
from scenarionet_data.errors import BadParameter
from scenarionet_data.samples.dataset import SampleKey
from scenarionet_data.schema import tables
from scenarionet_data.storage.files.places import local_path


@dataclass(frozen=True, eq=False)
class Prediction:
    """The predicted trajectories of one target.

    Attributes:
        scenario_id, track_id: The target.
        timestep: Last timestep of the history.
        dt: Time between positions [s].
        modes: (K, F, 2) float64 [m] in the scenario's frame, by descending probability.
        probabilities: (K,) float64, as given.
        given: (K,) places of the modes in the order in which they were given; None if that is this order.
    """

    scenario_id: str
    track_id: str
    timestep: int
    dt: float
    modes: Float64
    probabilities: Float64
    given: IntP | None = None

    @property
    def normalised(self) -> Float64:
        """(K,) probabilities whose sum is 1."""
        total = self.probabilities.sum()
        count = len(self.probabilities)
        return self.probabilities / total if total > 0 else np.full(count, 1 / count)


def make_predictions(keys: Sequence[SampleKey], modes: Array, probabilities: Array, pose: Array, dt: float) -> pa.Table:
    """Predictions for the first target of each sample, as rows to write.

    Args:
        keys: What each sample shows, see ``Samples.key``.
        modes: (B, K, F, 2) positions [m] in the frames of the samples.
        probabilities: (B, K).
        pose: (B, 4) the samples' ``pose``.
        dt: Time between positions [s].
    """
    modes, pose = (np.asarray(each, np.float64) for each in (modes, pose))
    count = len(pose) if pose.ndim else 0
    found = modes.shape, np.shape(probabilities), pose.shape, len(keys) if isinstance(keys, Sequence) else 0
    if modes.ndim != 4 or found != ((count, *modes.shape[1:3], 2), modes.shape[:2], (count, 4), count):
        raise BadParameter(
            f"{found[3]} keys, modes {found[0]}, probabilities {found[1]}, pose {found[2]}; expected a key of each "
            "sample, (samples, modes, steps, 2), (samples, modes) and (samples, 4)"
        )
    mirrored = modes * np.stack([np.ones(len(pose)), pose[:, 3]], axis=-1)[:, None, None]
    there = rotate(mirrored, pose[:, 2, None, None]) + pose[:, None, None, :2]
    count, num_modes = there.shape[:2]
    flat = there.reshape(count * num_modes, -1, 2).astype(np.float32)
    columns = {
        "scenario_id": np.repeat([key.scenario_id for key in keys], num_modes).tolist(),
        "track_id": np.repeat([key.track_ids[0] for key in keys], num_modes).tolist(),
        "timestep": np.repeat([key.timestep for key in keys], num_modes),
        "dt": np.full(count * num_modes, dt),
        "mode": np.tile(np.arange(num_modes), count),
        "probability": np.asarray(probabilities, np.float32).reshape(-1),
        "x": list(flat[..., 0]),
        "y": list(flat[..., 1]),
    }
    return pa.table(columns, schema=tables.load("predictions").schema)


def read_predictions(path: Path | str) -> list[Prediction]:
    """Predictions of a Parquet file, by scenario and target.

    Raises:
        BadParameter: A column is missing or has another type, or the trajectories of a target do not agree.
    """
    table = tables.load("predictions")
    try:
        found = pq.read_table(path)
        rows = pa.table({f.name: found[f.name].cast(f.type) for f in table.schema}, schema=table.schema)
    except FileNotFoundError as error:
        raise BadParameter(f"{path}: no such file; expected predictions in Parquet") from error
    except (KeyError, pa.ArrowException) as error:
        raise BadParameter(f"{path}: expected the columns of schemas/predictions.toml, found {error}") from error
    ordered = rows.sort_by([(name, "ascending") for name in ("scenario_id", "track_id", "timestep", "mode")])
    return list(_targets(ordered.combine_chunks(), str(path)))


def _targets(rows: pa.Table, path: str) -> Iterator[Prediction]:
    """Group rows that are sorted by target."""
    keys = list(zip(*(rows[name].to_pylist() for name in ("scenario_id", "track_id", "timestep", "dt")), strict=True))
    x, y = (rows[name].to_pylist() for name in ("x", "y"))
    probability = rows["probability"].to_numpy().astype(np.float64)
    start = 0
    for end in range(1, len(keys) + 1):
        if end < len(keys) and keys[end] == keys[start]:
            continue
        scenario_id, track_id, timestep, dt = keys[start]
        lengths = {len(line) for line in (*x[start:end], *y[start:end])}
        if len(lengths) != 1 or lengths == {0}:
            wanted = "trajectories of one length, at least 1"
            raise BadParameter(f"{path}: {track_id} of {scenario_id}: expected {wanted}, found {sorted(lengths)}")
        modes = np.stack([np.array(x[start:end]), np.array(y[start:end])], axis=-1)
        if not np.isfinite(modes).all() or not (probability[start:end] >= 0).all():
            raise BadParameter(
                f"{path}: {track_id} of {scenario_id}: expected finite positions, probabilities of 0 or more"
            )
        order = np.argsort(-probability[start:end], kind="stable")
        yield Prediction(scenario_id, track_id, timestep, dt, modes[order], probability[start:end][order], order)
        start = end


def write_predictions(path: Path | str, rows: Sequence[pa.Table]) -> None:
    """Write predictions of batches, see :func:`make_predictions`, to a Parquet file."""
    if not rows or not all(isinstance(each, pa.Table) for each in rows):
        raise BadParameter("rows: expected at least one table of make_predictions in a list; batches without samples?")
    pq.write_table(pa.concat_tables(rows), local_path(path, "a file of predictions"))
