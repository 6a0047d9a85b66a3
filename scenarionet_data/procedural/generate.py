"""Generate an episode from a seed: a map, its traffic over time, lights and road works."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import shapely
from shapely import Polygon

from scenarionet_data.arrays.dtypes import Bool, Float64, Int32
from scenarionet_data.errors import BadParameter
from scenarionet_data.procedural import sections
from scenarionet_data.procedural.bottlenecks import bidirection, bottleneck, split
from scenarionet_data.procedural.drawn_map import DrawnMap
from scenarionet_data.procedural.drive import drive
from scenarionet_data.procedural.flow import LATEST, flow
from scenarionet_data.procedural.graph import LaneGraph, make_graph, signal_rows
from scenarionet_data.procedural.intersection import intersection, t_intersection, u_turn
from scenarionet_data.procedural.options import BLOCK_NAMES, LETTERS, GeneratorOptions
from scenarionet_data.procedural.parking import add_parking
from scenarionet_data.procedural.path import Pose
from scenarionet_data.procedural.plazas import TOLL_ROOM, parking_lot, toll_gate
from scenarionet_data.procedural.population import WARM_UP, Population, boxes, place_construction, populate
from scenarionet_data.procedural.right_of_way import CAUTION, GO, STOP
from scenarionet_data.procedural.roadmap import Block, Obstacle, Road, RoadMap, Socket
from scenarionet_data.procedural.roundabout import roundabout
from scenarionet_data.procedural.sections import add_road, ids_of
from scenarionet_data.procedural.sidewalks import add_crossings, people_on


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
    graph = make_graph(road_map)._replace(flows=options.version != "v1")
    graph, obstacles = place_construction(road_map, graph, options.construction, rng)
    for block in road_map.blocks:
        obstacles += block.obstacles
    _, rows = signal_rows(road_map.lanes)
    if options.version == "v1":
        population = populate(road_map, graph, options, rng)
        lights = make_lights(rows, options.max_steps, options.dt, rng)
        motion, valid = drive(graph, population.vehicles, lights, options.dt)
        return Episode(road_map, graph, population, motion, valid, lights[:, : valid.shape[1]], obstacles)
    steps = options.max_steps + round((WARM_UP + LATEST) / options.dt)
    graph = add_crossings(road_map, graph)
    population = populate(road_map, graph, options, rng, steps * options.dt)
    walkers, sizes = people_on(road_map, options.pedestrians, steps * options.dt, options.dt, rng)
    population = replace(
        population,
        kinds=population.kinds + ["pedestrian"] * len(sizes),
        size=np.concatenate([population.size, sizes]),
    )
    obstacles = obstacles + add_parking(road_map, graph, options.parking, rng)
    lights = make_lights(rows, steps, options.dt, rng)
    poses, sizes = boxes(obstacles)
    standing = np.concatenate([poses, sizes[:, :2]], axis=1)
    motion, valid, begin = flow(graph, population, walkers, lights, standing, options.dt)
    lights = lights[:, begin : begin + valid.shape[1]]
    seen = np.asarray(valid.any(axis=1), np.bool_)
    return Episode(road_map, graph, population.select(seen), motion[seen], valid[seen], lights, obstacles)


YELLOW = 3.0  # [s]
ALL_RED = 2.0  # [s]
GREEN = (9.0, 16.0)  # [s] shortest and longest


def make_lights(rows: list[tuple[int, int]], steps: int, dt: float, rng: np.random.Generator) -> Int32:
    """Return (rows, steps) GO, CAUTION or STOP for the (junction, axis) of each row."""
    lights = np.full((max(len(rows), 1), steps), STOP, dtype=np.int32)
    for junction in sorted({junction for junction, _ in rows}):
        greens = rng.uniform(*GREEN, size=2)
        starts = np.array([0.0, greens[0] + YELLOW + ALL_RED])
        cycle = starts[1] + greens[1] + YELLOW + ALL_RED
        offset = rng.uniform(0.0, cycle)
        for axis in (0, 1):
            if (junction, axis) in rows:
                since = (np.arange(steps) * dt + offset - starts[axis]) % cycle
                row = lights[rows.index((junction, axis))]
                row[since < greens[axis] + YELLOW] = CAUTION
                row[since < greens[axis]] = GO
    return lights


_PLAIN: dict[str, Callable[[Block, Socket, np.random.Generator], None]] = {
    "straight": sections.straight,
    "curve": sections.curve,
    "fork": sections.fork,
    "merge": sections.merge,
    "on_ramp": sections.on_ramp,
    "off_ramp": sections.off_ramp,
    "roundabout": roundabout,
    "parking_lot": parking_lot,
    "toll_gate": toll_gate,
}
_CROSSING = {
    "intersection": intersection,
    "t_intersection": t_intersection,
    "u_turn": u_turn,
    "bidirection": bidirection,
}
_BOTTLENECKS = {"split": split, "bottleneck": bottleneck}
_ATTEMPTS = 30
_MAPS = 200
_MAX_RING_LANES = 2


def make_map(options: GeneratorOptions, rng: np.random.Generator) -> RoadMap:
    """Return a straight road followed by ``num_blocks`` random blocks, redrawn where they would overlap.

    Starts again in the rare case that no block fits the end of the last one.

    Raises:
        BadParameter: None of the blocks that the options allow fits.
    """
    for _ in range(_MAPS):
        road = Road(options.lane_width, float(rng.uniform(options.min_speed_limit, options.max_speed_limit)))
        count = int(rng.integers(options.min_lanes, options.max_lanes + 1))
        first = Block("start", 0, road)
        entrance = Socket(Pose(0.0, 0.0, 0.0), ((),) * count, ((),) * count)
        end: Socket | None = add_road(first, "", entrance, ((rng.uniform(30.0, 50.0), 0.0),))
        chain, surface = [first], list(first.footprint)
        names = [LETTERS[letter] for letter in options.sequence]
        while end and len(chain) <= (len(names) or options.num_blocks):
            drawn = replace(options, blocks=f"{names[len(chain) - 1]}=1") if names else options
            block = _draw_block(drawn, rng, Block("", len(chain), road), end, surface)
            chain.append(block)
            surface += block.footprint
            end = block.exit
        if end:
            start = sum(ids_of(first.lanes[:count]), ())
            return RoadMap(road, tuple(chain), start, sum(end.forward, ()))
    raise BadParameter(
        f"{options.sequence or f'{options.num_blocks} of blocks={options.blocks!r}'} "
        f"on roads of {options.min_lanes} to {options.max_lanes} "
        f"lanes never fit together (a roundabout has at most {_MAX_RING_LANES} lanes, shared lanes and car parks have "
        f"one each way, a bottleneck needs another number of lanes, a toll gate lanes of {TOLL_ROOM:g} m); "
        "allow other blocks, or fewer"
    )


def _draw_block(
    options: GeneratorOptions, rng: np.random.Generator, empty: Block, end: Socket, surface: list[Polygon]
) -> Block:
    """Return the first random block that fits the end and the surface of the roads so far, or else ``empty``."""
    forward, backward, weights = len(end.forward), len(end.backward), dict(options.weights)
    fewest, most = sorted((forward, backward))
    room = {"split": options.max_lanes - most, "bottleneck": fewest - options.min_lanes}
    for name, is_excluded in (
        ("fork", forward >= options.max_lanes),
        ("merge", forward <= options.min_lanes),
        ("roundabout", forward != backward or forward > _MAX_RING_LANES),
        ("split", room["split"] < 1),
        ("bottleneck", room["bottleneck"] < 1),
        ("bidirection", most > 1),
        ("parking_lot", most > 1),
        ("toll_gate", options.lane_width < TOLL_ROOM),
    ):
        weights[name] *= not is_excluded
    total = sum(weights.values())
    for _ in range(_ATTEMPTS if total else 0):
        name = str(rng.choice(BLOCK_NAMES, p=np.array(list(weights.values())) / total))
        block = Block(name, empty.index, empty.road)
        if name in _CROSSING:
            _CROSSING[name](block, end, rng, bool(rng.random() < options.lights))
        elif name in _BOTTLENECKS:
            _BOTTLENECKS[name](block, end, rng, room[name])
        else:
            _PLAIN[name](block, end, rng)
        common = shapely.area(shapely.intersection(np.array(block.footprint)[:, None], np.array(surface)))
        if common.max() <= 0.5:
            return block
    return empty
