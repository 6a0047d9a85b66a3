"""What the compiled step reads and writes, except for the structures of worlds."""

from __future__ import annotations

from typing import NamedTuple

from scenarionet_data.arrays.dtypes import Float64, Int32
from scenarionet_sim.arrays.structures import Lines, Recorded, StateArrays
from scenarionet_sim.policies.traffic import Traffic
from scenarionet_sim.sensors.observation_kernels import Sensing
from scenarionet_sim.simulation.agent_kernels import DrivenArrays
from scenarionet_sim.simulation.recording import EpisodeArrays
from scenarionet_sim.simulation.seats import Seats
from scenarionet_sim.task.scoring_kernels import StepResult


class StepSettings(NamedTuple):
    """What is the same in all worlds and steps.

    Attributes:
        dt: Length of the step [s].
        back, ahead: Search window on a path around an agent [m].
        are_own_routes: Whether the routes of the agents are those of the state; otherwise they have their own.
        substeps: Of the vehicle model.
        num_observed: Number of places of each world whose agents are observed.
    """

    dt: float
    back: float
    ahead: float
    are_own_routes: bool
    substeps: int
    num_observed: int


class StepArrays(NamedTuple):
    """What steps read and write.

    Attributes:
        begins: (W,) timesteps of the logs at which episodes begin in this step, or ``AT_FIRST``, in worlds that do not
            move in it; ``BEGUN`` once they have begun, and ``GOES_ON`` in other worlds.
        recorded, lines: Worlds.
        now, then: Current and next state.
        traffic: Policies.
        agents: Agents and their contacts.
        vehicles: (W, N, NUM_COLUMNS) see ``backends.bicycle_kernels``.
        new_vehicle: (NUM_COLUMNS,) a vehicle at the beginning of an episode; empty if the backend sets the vehicles.
        task: (16,) see ``task.task_parameters``.
        totals: (W, N, 9) sums over the episodes of the agents, see ``NUM_TOTALS``.
        seats: Flat buffers.
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
    totals: Float64
    seats: Seats


class Exchange(NamedTuple):
    """What a step gets and returns, which may be in other arrays in every step.

    Attributes:
        actions: (C, 2) steering and throttle of the agents by place.
        result: Scores.
        sensing: Sensors, and their observations.
        episodes: Recorded episodes, see ``RECORD``.
    """

    actions: Float64
    result: StepResult
    sensing: Sensing
    episodes: EpisodeArrays
