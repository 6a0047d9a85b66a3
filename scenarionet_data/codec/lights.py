"""Encode traffic lights as table rows, and decode them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise
from typing import ClassVar

import numpy as np
import pyarrow as pa

from scenarionet_data.arrays.columns import Columns
from scenarionet_data.arrays.memory import Memory
from scenarionet_data.codec.arrow import batch, names_of, string_array
from scenarionet_data.codec.columns import ScenarioColumns, codes_of_words
from scenarionet_data.codec.light_kernels import fill_lights
from scenarionet_data.codec.stored_part import STEPS, StoredPart
from scenarionet_data.errors import LakeError
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


def decode_lights(rows: ScenarioColumns | None, steps: Sequence[int]) -> list[Lights]:
    """Decode the lights of scenarios.

    Args:
        rows: Rows of the lights table; None when no scenario has lights.
        steps: (scenarios) number of timesteps.

    Raises:
        LakeError: The number of states differs from the number of timesteps: the file is damaged.
    """
    if rows is None:
        return [_no_lights(num_steps) for num_steps in steps]
    columns, memory, bounds = rows.columns, rows.memory, pairwise(rows.bounds)
    return [_lights(columns, first, last, count, memory) for (first, last), count in zip(bounds, steps, strict=True)]


@lru_cache(64)
def _no_lights(steps: int) -> Lights:
    return Lights.empty(steps)


class StoredLights(StoredPart):
    """Lights in memory; see ``Lights`` for the shapes.

    Args:
        columns: Rows.
        first, last: Those of the scenario.
        steps: T.
        memory: Where to take theirs from.
    """

    arrays: ClassVar = {
        "stop_point": (np.float32, "rows", (3,)),
        "state": (np.uint8, "rows", (STEPS,)),
        "is_lane_in_map": (np.bool_, "rows", ()),
        "provenance": (np.uint8, "rows", ()),
    }
    texts: ClassVar = {"ids": "light_id", "lane_ids": "lane_id"}


_COLUMNS = ("stop_x", "stop_y", "stop_z", "state", "is_lane_in_map", "provenance")


def _lights(columns: Columns, first: int, last: int, steps: int, memory: Memory) -> Lights:
    """Lights of one scenario."""
    stored = StoredLights(columns, first, last, steps, memory)
    states = codes_of_words(columns, "state", LightState)
    provenances = codes_of_words(columns, "provenance", Provenance)
    described = columns.layout.places(_COLUMNS), stored.plan, first, last, steps, states, provenances
    if not fill_lights(columns.block, *described, stored.memory, stored.places):
        raise LakeError(
            "lights.state does not have one state per timestep: its file is damaged; `scenarionet maintain check` "
            "lists the affected scenarios; restore the file from a copy of the lake, or convert its recordings again"
        )
    return Lights.read({}, stored)
