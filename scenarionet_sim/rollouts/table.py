"""Convert rollouts to rows of ``schemas/rollouts.toml``."""

from __future__ import annotations

import numpy as np
import pyarrow as pa

from scenarionet_data.arrays.columns import offsets_of
from scenarionet_data.arrays.dtypes import Bool, Float64
from scenarionet_data.codec.arrow import list_array, names_of, string_array
from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_data.schema import tables
from scenarionet_sim.rollouts.rollout import Rollout
from scenarionet_sim.worlds.world import World


def rollout_rows(rollout: Rollout, world: World, number: int = 0) -> pa.Table:
    """Return rows of ``schemas/rollouts.toml`` without the column run; ``number`` is that of the rollout."""
    rows = np.flatnonzero(rollout.present.any(axis=0))
    present = rollout.present[:, rows].T
    offsets = offsets_of(np.full(len(rows), present.shape[1]))
    is_always: Bool = np.asarray(present.all(axis=1))
    some = offsets_of(np.where(is_always, 0, present.shape[1]))  # Parquet writers want null lists to be empty

    def column(values: Float64) -> pa.Array:
        return list_array(offsets, np.where(present, values[:, rows].T, 0.0).astype(np.float32).ravel())

    columns = {
        "scenario_id": pa.array([rollout.scenario_id] * len(rows), pa.string()),
        "track_id": string_array(world.track_ids[rows]),
        "object_type": names_of(world.object_type[rows], ObjectType),
        "is_judged": pa.array(rows == rollout.agent),
        "start": pa.array(np.full(len(rows), rollout.start, np.int32)),
        "x": column(rollout.position[..., 0]),
        "y": column(rollout.position[..., 1]),
        "heading": column(rollout.heading),
        "vx": column(rollout.velocity[..., 0]),
        "vy": column(rollout.velocity[..., 1]),
        "valid": list_array(some, present[~is_always].ravel(), mask=is_always),
        "rollout": pa.array(np.full(len(rows), number, np.int32)),
    }
    return pa.table(columns)


def concat_rollouts(rollouts: list[pa.Table]) -> pa.Table:
    """Concatenate the rows of any number of rollouts."""
    schema = tables.load("rollouts").schema
    empty = schema.remove(schema.get_field_index("run")).empty_table()
    return pa.concat_tables([empty, *(rows.cast(empty.schema) for rows in rollouts)])
