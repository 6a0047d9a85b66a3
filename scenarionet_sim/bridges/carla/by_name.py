"""Agents of CARLA's leaderboard by name, in a process and an environment of their own."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial
from typing import Any

from scenarionet_data.errors import BadParameter
from scenarionet_data.public_names import load_by_name
from scenarionet_sim.planners.base import Planner


def load_agent(reference: str) -> Callable[[], Planner]:
    """Return what makes planners of an agent, in the environment of this process.

    Args:
        reference: ``module:Class``, in a folder of the import path.

    Raises:
        BadParameter: CARLA's client is not installed, or the class cannot be imported, or is no agent.
    """
    # What agents need is imported with them, as other policies have no use for it.
    from scenarionet_sim.bridges.carla.planner import AgentPlanner
    from scenarionet_sim.bridges.carla.stand_ins import stand_in

    try:
        stand_in()
    except ModuleNotFoundError as error:
        raise BadParameter(
            f"agents of CARLA need its client, which {sys.executable} lacks; name another environment by --python, "
            "such as a requirements file with carla==0.9.16"
        ) from error
    try:
        kind: Any = load_by_name(reference)
    except BadParameter as error:
        raise BadParameter(
            f"{error} Have a checkout of CARLA's leaderboard in PYTHONPATH; agents that drive by CARLA's world or its "
            "own agents are not driven here"
        ) from error
    lacking = [name for name in ("setup", "sensors", "run_step") if not callable(getattr(kind, name, None))]
    if lacking:
        raise BadParameter(
            f"{reference} has no {', '.join(lacking)}; expected an AutonomousAgent of CARLA's leaderboard"
        )
    return partial(AgentPlanner, kind)
