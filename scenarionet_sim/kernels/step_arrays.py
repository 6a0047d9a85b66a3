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
        is_agent: (256,) policies whose objects are agents.
        rows: (A, 2) world and row.
        first: (W + 1,) first agent of each world.
        actions: (A, 2) steering and throttle.
        route, route_before: (W, N, 2) location on their paths, see ``State``; after the step, and before it.
        contacts, contacts_before: (A, N) objects that they touch.
        hits: (A,) types of those objects, as bits.
    """

    is_agent: Bool
    rows: Int32
    first: Int32
    actions: Float64
    route: Float64
    route_before: Float64
    contacts: Bool
    contacts_before: Bool
    hits: npt.NDArray[np.uint32]


BEGUN, GOES_ON = -1, -2
"""Of a world: its episode has begun and does not move in this step; its episode goes on."""


class StepArrays(NamedTuple):
    """What a step reads and writes.

    Attributes:
        begins: (W,) timesteps of the logs at which episodes begin in this step, in worlds that do not move in it;
            ``BEGUN`` once they have begun, and ``GOES_ON`` in other worlds.
        recorded, lines: Worlds.
        now, then: Current and next state.
        traffic: Policies.
        agents: Agents and their contacts.
        vehicles: (W, N, NUM_COLUMNS) see ``kernels.bicycle``.
        new_vehicle: (NUM_COLUMNS,) a vehicle at the beginning of an episode; empty if the backend sets the vehicles.
        task: (12,) see ``task.task_parameters``.
        result: Scores.
        sensing: Sensors.
    """

    begins: Int32
    recorded: Recorded
    lines: Lines
    now: StateArrays
    then: StateArrays
    traffic: Traffic
    agents: DrivenArrays
    vehicles: Float64
    new_vehicle: Float64
    task: Float64
    result: StepResult
    sensing: Sensing
