"""Lights to rows and back."""

from __future__ import annotations

import numpy as np
import pyarrow as pa

from scenarionet_data import tables
from scenarionet_data.codec.arrow import Rows, batch, bools, codes_of, floats, names_of, string_array, strings
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


def decode_lights(rows: Rows | None, steps: int) -> Lights:
    """Lights over ``steps`` timesteps from their rows; none for None."""
    if rows is None or not rows.num_rows:
        return Lights.empty(steps)
    state = codes_of(rows.column("state").flatten(), LightState).reshape(rows.num_rows, steps)
    stop = [floats(rows, name) for name in ("stop_x", "stop_y", "stop_z")]
    # Without heights stop_z is null, and a known stop point lies at z = 0 like everything else.
    stop[2] = np.where(np.isnan(stop[2]) & ~np.isnan(stop[0]), np.float32(0), stop[2])
    return Lights(
        ids=strings(rows, "light_id"),
        lane_ids=strings(rows, "lane_id"),
        stop_point=np.stack(stop, axis=1),
        state=state,
        is_lane_in_map=bools(rows, "is_lane_in_map"),
        provenance=codes_of(rows.column("provenance"), Provenance),
    )
