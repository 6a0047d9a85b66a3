"""Draw road blocks and join them into a map that does not overlap itself."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import shapely
from shapely import Polygon

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.errors import BadParameter
from scenarionet_data.procedural import blocks
from scenarionet_data.procedural.intersection import intersection, t_intersection
from scenarionet_data.procedural.options import GeneratorOptions
from scenarionet_data.procedural.path import Pose
from scenarionet_data.procedural.roadmap import Block, Road, RoadMap, Socket
from scenarionet_data.procedural.roundabout import roundabout
from scenarionet_data.procedural.sections import add_road

_PLAIN: dict[str, Callable[[Block, Socket, np.random.Generator], None]] = {
    "straight": blocks.straight,
    "curve": blocks.curve,
    "fork": blocks.fork,
    "merge": blocks.merge,
    "on_ramp": blocks.on_ramp,
    "off_ramp": blocks.off_ramp,
    "roundabout": roundabout,
}
_CROSSING = {"intersection": intersection, "t_intersection": t_intersection}
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
        road_map = _try_map(options, rng)
        if road_map is not None:
            return road_map
    raise BadParameter(
        f"{options.num_blocks} of blocks={options.blocks!r} on roads of {options.min_lanes} to {options.max_lanes} "
        f"lanes never fit together (a roundabout has at most {_MAX_RING_LANES} lanes); allow other blocks, or fewer"
    )


def _try_map(options: GeneratorOptions, rng: np.random.Generator) -> RoadMap | None:
    road = Road(options.lane_width, float(rng.uniform(options.min_speed_limit, options.max_speed_limit)))
    count = int(rng.integers(options.min_lanes, options.max_lanes + 1))
    first = Block("start", 0, road)
    entrance = Socket(Pose(0.0, 0.0, 0.0), ((),) * count, ((),) * count)
    end = add_road(first, "", entrance, ((rng.uniform(30.0, 50.0), 0.0),))
    chain = [first]
    for index in range(1, options.num_blocks + 1):
        block = _draw_block(options, rng, index, chain, end)
        if block is None or block.exit is None:
            return None
        chain.append(block)
        end = block.exit
    start = tuple(lane.id for lane in first.lanes[:count])
    return RoadMap(road, tuple(chain), start, tuple(lane for lanes in end.forward for lane in lanes))


def _draw_block(
    options: GeneratorOptions, rng: np.random.Generator, index: int, chain: list[Block], end: Socket
) -> Block | None:
    """Return the first random block that fits, or None."""
    names, weights = _fitting(options, end)
    if not names:
        return None
    for _ in range(_ATTEMPTS):
        name = str(rng.choice(names, p=weights))
        block = Block(name, index, chain[0].road)
        if name in _CROSSING:
            _CROSSING[name](block, end, rng, bool(rng.random() < options.lights))
        else:
            _PLAIN[name](block, end, rng)
        if not _overlaps(block.footprint, [shape for other in chain for shape in other.footprint]):
            return block
    return None


def _fitting(options: GeneratorOptions, end: Socket) -> tuple[list[str], Float64]:
    """Kinds of block that fit the number of lanes, with their probabilities."""
    forward, backward = len(end.forward), len(end.backward)
    excluded = set()
    if forward >= options.max_lanes:
        excluded.add("fork")
    if forward <= options.min_lanes:
        excluded.add("merge")
    if forward != backward or forward > _MAX_RING_LANES:
        excluded.add("roundabout")
    weights = {name: weight for name, weight in options.weights.items() if weight > 0 and name not in excluded}
    total = sum(weights.values())
    return list(weights), np.array(list(weights.values())) / (total or 1.0)


def _overlaps(shapes: list[Polygon], others: list[Polygon]) -> bool:
    """Whether any two surfaces share an area."""
    common = shapely.intersection(np.array(shapes)[:, None], np.array(others)[None, :])
    return bool(shapely.area(common).max() > 0.5)
