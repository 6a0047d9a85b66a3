"""One episode as arrays: what everybody did, what the judged vehicle touched, how it ended."""

from __future__ import annotations

from dataclasses import dataclass

from scenarionet_data.scenario import Bool, Float64


@dataclass(frozen=True, eq=False)
class Rollout:
    """An episode of T moments, the first before any step, of N objects as in the scenario's world.

    Attributes:
        scenario_id: The scenario.
        start: Timestep of the log at the first moment.
        dt: Seconds between moments.
        agent: Row of the vehicle that is judged.
        end: How it ended: ``success``, ``out_of_road`` or ``timeout``.
        completion: Share of the route that was done, 0 to 1.
        progress: Way along the route [m].
        position: (T, N, 2) float64 [m].
        heading: (T, N) float64 [rad].
        velocity: (T, N, 2) float64 [m/s].
        present: (T, N) bool.
        contacts: (T, N) bool whose box the agent's box overlaps.
    """

    scenario_id: str
    start: int
    dt: float
    agent: int
    end: str
    completion: float
    progress: float
    position: Float64
    heading: Float64
    velocity: Float64
    present: Bool
    contacts: Bool

    @property
    def num_steps(self) -> int:
        """Steps taken: T - 1."""
        return len(self.position) - 1
