"""All metrics of a rollout, as a row of ``schemas/results.toml``."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

from scenarionet_sim.metrics import results
from scenarionet_sim.metrics.drive import DrivenEpisode
from scenarionet_sim.metrics.episodes import DrivenEpisodes, MeasuredColumns, known, rows_of
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
    """Return the metrics of some episodes, or why one has none; those on one map together."""
    of_map: dict[int, list[int]] = {}
    for number, episode in enumerate(episodes):
        of_map.setdefault(id(episode.world.roads), []).append(number)
    rows: dict[int, dict[str, Any] | Exception] = {}
    for numbers in of_map.values():
        rows |= zip(numbers, _measure_on_one_map([episodes[number] for number in numbers]), strict=True)
    return [rows[number] for number in range(len(episodes))]


def _measure_on_one_map(episodes: list[DrivenEpisode]) -> list[dict[str, Any] | Exception]:
    """Return the metrics of episodes; what fails in a group is repeated one by one, so that each fails on its own."""
    single, together = metrics()
    try:
        rows: list[dict[str, Any]] = [{} for _ in episodes]
        for metric in single:
            for row, episode in zip(rows, episodes, strict=True):
                row |= {name: known(value) for name, value in metric(episode).items()}
        whole = [number for number, episode in enumerate(episodes) if episode.is_whole]
        if whole:
            group = DrivenEpisodes.of([episodes[number] for number in whole])
            for metric_of_group in together:
                for number, found in zip(whole, rows_of(metric_of_group(group), len(whole)), strict=True):
                    rows[number] |= found
    except MemoryError:
        raise
    except Exception as error:  # one scenario must not end the run
        if len(episodes) == 1:
            return [error]
        return [found for episode in episodes for found in _measure_on_one_map([episode])]
    return [*rows]


@cache
def metrics() -> tuple[
    list[Callable[[DrivenEpisode], dict[str, Any]]], list[Callable[[DrivenEpisodes], MeasuredColumns]]
]:
    """Return the functions of the modules in ``results``: each ``measure``, and each ``measure_together``."""
    names = sorted(module.name for module in pkgutil.iter_modules(results.__path__, f"{results.__name__}."))
    modules = [importlib.import_module(name) for name in names]
    single = [module.measure for module in modules if hasattr(module, "measure")]
    return single, [module.measure_together for module in modules if hasattr(module, "measure_together")]
