"""Generate an episode from a seed: a map, its traffic over time, lights and road works."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64, Int32
from scenarionet_data.procedural.assemble import make_map
from scenarionet_data.procedural.construction import Obstacle, place_construction
from scenarionet_data.procedural.drawn_map import DrawnMap
from scenarionet_data.procedural.drive import drive
from scenarionet_data.procedural.graph import LaneGraph, make_graph, signal_rows
from scenarionet_data.procedural.options import GeneratorOptions
from scenarionet_data.procedural.population import Population, populate
from scenarionet_data.procedural.roadmap import RoadMap
from scenarionet_data.procedural.signals import make_lights


@dataclass(frozen=True, eq=False)
class Episode:
    """A generated map and its traffic.

    Attributes:
        road_map: The map.
        graph: Its lanes as arrays, numbered as in ``road_map.lanes``.
        population: The vehicles, the ego first.
        motion: (N, T, 4) x, y [m], heading [rad], speed [m/s].
        valid: (N, T).
        lights: (rows, T) states of the lights, see ``right_of_way``.
        obstacles: Stationary objects.
    """

    road_map: RoadMap
    graph: LaneGraph
    population: Population
    motion: Float64
    valid: Bool
    lights: Int32
    obstacles: list[Obstacle]


def generate(seed: int, options: GeneratorOptions, drawn: DrawnMap | None = None) -> Episode:
    """Generate the episode of a seed, on a map of its own or a given one; deterministic to the bit."""
    rng = np.random.Generator(np.random.PCG64(seed))
    road_map = make_map(options, rng) if drawn is None else drawn.with_ends(rng)
    graph = make_graph(road_map)
    graph, obstacles = place_construction(road_map, graph, options.construction, rng)
    population = populate(road_map, graph, options, rng)
    _, rows = signal_rows(road_map.lanes)
    lights = make_lights(rows, options.max_steps, options.dt, rng)
    motion, valid = drive(graph, population.vehicles, lights, options.dt)
    return Episode(road_map, graph, population, motion, valid, lights[:, : valid.shape[1]], obstacles)
