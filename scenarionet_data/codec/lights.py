"""Encode traffic lights as table rows, and decode them."""

from __future__ import annotations

from functools import lru_cache
from typing import ClassVar

import numpy as np
import pyarrow as pa

from scenarionet_data.codec.arrow import batch, names_of, string_array
from scenarionet_data.codec.light_kernels import fill_lights
from scenarionet_data.codec.stored_part import STEPS, StoredPart
from scenarionet_data.scenario.description import Lights
from scenarionet_data.scenario.vocabulary import LightState, Provenance
from scenarionet_data.schema import tables


def encode_lights(scenario_id: str, lights: Lights, has_z: bool) -> pa.RecordBatch:
    """Encode a scenario's lights as rows."""
    count, steps = lights.state.shape
    stop = lights.stop_point
    known = ~np.isnan(stop)
    state = pa.ListArray.from_arrays(
        pa.array(np.arange(count + 1, dtype=np.int32) * steps),
        names_of(lights.state.ravel(), LightState),
        type=tables.load("lights").schema.field("state").type,
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


@lru_cache(64)
def no_lights(steps: int) -> Lights:
    """Lights of a scenario without any."""
    return Lights.empty(steps)


class StoredLights(StoredPart):
    """Lights in memory; see ``Lights`` for the shapes."""

    table = "lights"
    columns = ("stop_x", "stop_y", "stop_z", "state", "is_lane_in_map", "provenance")
    words: ClassVar = {"state": LightState, "provenance": Provenance}
    fill = fill_lights
    expected = "does not have one state per timestep"
    arrays: ClassVar = {
        "stop_point": (np.float32, "rows", (3,)),
        "state": (np.uint8, "rows", (STEPS,)),
        "is_lane_in_map": (np.bool_, "rows", ()),
        "provenance": (np.uint8, "rows", ()),
    }
    texts: ClassVar = {"ids": "light_id", "lane_ids": "lane_id"}
