"""All metrics of a rollout, as a row of ``schemas/results.toml``."""

from __future__ import annotations

import importlib
import math
import pkgutil
from collections.abc import Callable, Sequence
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
    (row,) = measure_all([DrivenEpisode(rollout, world)])
    if isinstance(row, Exception):
        raise row
    return row


def measure_all(episodes: Sequence[DrivenEpisode]) -> list[dict[str, Any] | Exception]:
    """Return the metrics of some episodes, or why one has none.

    They are computed metric by metric, whose code then stays in the processor's cache.
    """
    rows: list[dict[str, Any] | Exception] = [{} for _ in episodes]
    for metric in metrics():
        for number, episode in enumerate(episodes):
            row = rows[number]
            if isinstance(row, Exception):
                continue
            try:
                for name, value in metric(episode).items():
                    row[name] = None if isinstance(value, float) and not math.isfinite(value) else value
            except MemoryError:
                raise
            except Exception as error:  # one scenario must not end the run
                rows[number] = error
    return rows


@cache
def metrics() -> tuple[Callable[[DrivenEpisode], dict[str, Any]], ...]:
    """Return the function ``measure`` of every module in ``results``."""
    names = sorted(module.name for module in pkgutil.iter_modules(results.__path__, f"{results.__name__}."))
    return tuple(importlib.import_module(name).measure for name in names)
