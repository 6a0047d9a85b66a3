"""Scenarios of an evaluation, loaded ahead of their rollouts."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import cache

from scenarionet_data import ScenarioLoader
from scenarionet_data.errors import MissingDependency
from scenarionet_sim.rollouts.span import EpisodeSpan
from scenarionet_sim.worlds.world import World

_TOGETHER = 8
"""Scenarios that are loaded by one call, which divides its fixed costs, while those before them are simulated."""

Loaded = tuple[World, int] | Exception
"""A scenario and the timestep at which it begins, or why it cannot be loaded."""


def loaded_ahead(loader: ScenarioLoader, indices: range, span: EpisodeSpan) -> Iterator[tuple[int, Loaded]]:
    """Yield scenarios, which a thread loads while those before them are simulated."""
    groups = [indices[start : start + _TOGETHER] for start in range(0, len(indices), _TOGETHER)]
    following = _thread().submit(_load, loader, groups[0], span)
    for number, group in enumerate(groups):
        loading = following
        if number + 1 < len(groups):
            following = _thread().submit(_load, loader, groups[number + 1], span)
        yield from zip(group, loading.result(), strict=True)


@cache
def _thread() -> ThreadPoolExecutor:
    """The thread that loads; one for all parts, as a loader opens files for each thread."""
    return ThreadPoolExecutor(1, thread_name_prefix="scenarios")


def _load(loader: ScenarioLoader, indices: range, span: EpisodeSpan) -> list[Loaded]:
    """Load scenarios together; one by one if that fails, so that each fails only on its own."""
    try:
        scenarios = loader.batch(indices)
    except (MemoryError, MissingDependency):
        raise
    except Exception as error:
        if len(indices) == 1:
            return [error]
        return [loaded for index in indices for loaded in _load(loader, range(index, index + 1), span)]
    found: list[Loaded] = []
    for scenario in scenarios:
        try:
            world = World.from_scenario(scenario)
            found.append((world, span.start(scenario, world)))
        except (MemoryError, MissingDependency):
            raise
        except Exception as error:  # one scenario must not end the run
            found.append(error)
    return found
