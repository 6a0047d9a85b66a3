"""How an episode ended, by ScenarioNet's task."""

from __future__ import annotations

from typing import Any

from scenarionet_sim.metrics.drive import DrivenEpisode


def measure(episode: DrivenEpisode) -> dict[str, Any]:
    """Return the outcome of the whole episode."""
    rollout = episode.rollout
    return {
        "status": rollout.end,
        "steps": rollout.num_steps,
        "outcome_time": None if rollout.end_step is None else rollout.end_step * rollout.dt,
        "success": rollout.end == "success",
        "out_of_road": rollout.end == "out_of_road",
        "timeout": rollout.end == "timeout",
        "route_completion": rollout.completion,
    }
