"""All metrics of a rollout, as a row of ``schemas/results.toml``."""

from __future__ import annotations

import importlib
import math
import pkgutil
from collections.abc import Callable
from functools import cache
from typing import Any

from scenarionet_sim.metrics import results
from scenarionet_sim.metrics.drive import DrivenEpisode
from scenarionet_sim.rollouts.rollout import Rollout
from scenarionet_sim.worlds.world import World


def measure(rollout: Rollout, world: World) -> dict[str, Any]:
    """Return the metrics of a rollout; null where the scenario lacks what a metric needs, such as a map or lights.

    The outcome and the collisions are those of the whole episode, all other metrics cover the time of the recording.
    """
    episode = DrivenEpisode(rollout, world)
    row = {name: value for metric in metrics() for name, value in metric(episode).items()}
    return {
        name: None if isinstance(value, float) and not math.isfinite(value) else value for name, value in row.items()
    }


@cache
def metrics() -> tuple[Callable[[DrivenEpisode], dict[str, Any]], ...]:
    """Return the function ``measure`` of every module in ``results``."""
    names = sorted(module.name for module in pkgutil.iter_modules(results.__path__, f"{results.__name__}."))
    return tuple(importlib.import_module(name).measure for name in names)
