"""Lights to rows and back."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pyarrow as pa

from scenarionet_data import tables
from scenarionet_data.codec.arrow import batch, names_of, string_array
from scenarionet_data.codec.columns import Columns
from scenarionet_data.errors import LakeError
from scenarionet_data.scenario import Lights
from scenarionet_data.vocabulary import LightState, Provenance


def encode_lights(scenario_id: str, lights: Lights, has_z: bool) -> pa.RecordBatch:
    """Rows of a scenario's lights."""
    count, steps = lights.state.shape
    stop = lights.stop_point
    known = ~np.isnan(stop)
    state = pa.ListArray.from_arrays(
        pa.array(np.arange(count + 1, dtype=np.int32) * steps),
        names_of(lights.state.ravel(), LightState),
        type=tables.load("lights").column("state").arrow_type,
    )
    columns = {
        "scenario_id": pa.array([scenario_id] * count, pa.string()),
        "light_id": string_array(lights.ids),
        "lane_id": string_array(lights.lane_ids),
        "stop_x": pa.array(stop[:, 0], mask=~known[:, 0]),
        "stop_y": pa.array(stop[:, 1], mask=~known[:, 1]),
        "stop_z": pa.array(stop[:, 2], mask=~(known[:, 2] & has_z)),
        "state": state,
        "is_lane_in_map": pa.array(lights.is_lane_in_map),
        "provenance": names_of(lights.provenance, Provenance),
    }
    return batch("lights", columns)


def decode_lights(rows: Columns | None, bounds: Sequence[int], steps: Sequence[int]) -> list[Lights]:
    """Lights of scenarios from their rows, one scenario after the other; none for None.

    Args:
        rows: Rows of the lights table.
        bounds: (scenarios + 1) row at which each scenario begins, and the last one ends.
        steps: (scenarios) timesteps of each.

    Raises:
        LakeError: States are not as many as timesteps: the file is damaged.
    """
    if rows is None:
        return [Lights.empty(num_steps) for num_steps in steps]
    column = rows.lists["state"]
    if not np.array_equal(column.lengths, np.repeat(steps, np.diff(bounds))):
        raise LakeError(
            "lights.state has not a state for each timestep: its file is damaged; `scenarionet check` names every "
            "scenario that is hit; restore the file from a copy of the lake, or convert its recordings again"
        )
    stop = np.column_stack([rows.flat[f"stop_{axis}"] for axis in "xyz"])
    # Without heights stop_z is null, and a known stop point lies at z = 0 like everything else.
    stop[np.isnan(stop[:, 2]) & ~np.isnan(stop[:, 0]), 2] = 0
    state, provenance = rows.codes("state", LightState), rows.codes("provenance", Provenance)
    ids, lane_ids, is_lane_in_map = rows.strings("light_id"), rows.strings("lane_id"), rows.flat["is_lane_in_map"]
    return [
        Lights(
            ids=ids[first:last].copy(),
            lane_ids=lane_ids[first:last].copy(),
            stop_point=stop[first:last].copy(),
            state=state[column.offsets[first] : column.offsets[last]].reshape(-1, num_steps).copy(),
            is_lane_in_map=is_lane_in_map[first:last].copy(),
            provenance=provenance[first:last].copy(),
        )
        for (first, last), num_steps in zip(pairwise(bounds), steps, strict=True)
    ]
