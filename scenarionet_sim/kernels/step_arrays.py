"""What the compiled step reads and writes, except for the structures of worlds."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from scenarionet_data.arrays.dtypes import Bool, Float64, Int32, UInt8
from scenarionet_sim.kernels.observation import Sensing
from scenarionet_sim.kernels.scoring import StepResult
from scenarionet_sim.kernels.structures import Lines, Recorded, StateArrays


class Traffic(NamedTuple):
    """Policies of P numbers.

    Attributes:
        driver: (W, N) policy of each object, or ``UNDRIVEN``.
        movement: (P,) see ``kernels.motion.REPLAY``.
        law: (W, P, 8) numbers of a ``Law``.
        colors: (K,) ``LightColor`` by ``LightState``.
    """

    driver: UInt8
    movement: UInt8
    law: Float64
    colors: UInt8


class DrivenArrays(NamedTuple):
    """Agents of W worlds in the order of their worlds and rows.

    Attributes:
        rows: (A, 2) world and row.
        first: (W + 1,) first agent of each world.
        actions: (A, 2) steering and throttle.
        route, route_before: (W, N, 2) location on their paths, see ``State``; after the step, and before it.
        contacts, contacts_before: (A, N) objects that they touch.
        hits: (A,) types of those objects, as bits.
    """

    rows: Int32
    first: Int32
    actions: Float64
    route: Float64
    route_before: Float64
    contacts: Bool
    contacts_before: Bool
    hits: npt.NDArray[np.uint32]


class StepArrays(NamedTuple):
    """What a step reads and writes.

    Attributes:
        has_begun: (W,) worlds that have just begun an episode: they do not move in this step.
        recorded, lines: Worlds.
        now, then: Current and next state.
        traffic: Policies.
        agents: Agents and their contacts.
        vehicles: (W, N, NUM_COLUMNS) see ``kernels.bicycle``.
        task: (12,) see ``task.task_parameters``.
        result: Scores.
        sensing: Sensors.
    """

    has_begun: Bool
    recorded: Recorded
    lines: Lines
    now: StateArrays
    then: StateArrays
    traffic: Traffic
    agents: DrivenArrays
    vehicles: Float64
    task: Float64
    result: StepResult
    sensing: Sensing
