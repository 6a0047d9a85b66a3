"""Fixtures of a world: traffic lights at their stop lines, and buildings, trees and lamps off the road by seed."""

from __future__ import annotations

import zlib

import numpy as np
import shapely

from scenarionet_data.arrays.dtypes import Float32, Float64, Int32
from scenarionet_sim.cameras.draw import codes as at
from scenarionet_sim.cameras.draw.facades import FOUNDATION
from scenarionet_sim.cameras.terrain import Terrain
from scenarionet_sim.worlds.world import World

_REACH = 160.0
"""Fixtures are closer than this to the ego's recorded path [m]."""

_MOST = 400
_DARK_PAINT, _LIGHT_PAINT = 14, 13
LIGHT_HEIGHT = 5.2
"""Height of the lower end of a traffic light's head [m]."""

_MAST_PLACES: Float64 = np.concatenate([np.arange(2.0, 26.0, 0.5), np.arange(-2.0, -26.0, -0.5)])
"""Where masts may stand, to the right of a stop line's middle [m], best ones first."""

_SCENERY = (
    ("building", 11.0, 32.0, 60), ("lamp", 0.7, 0.9, 22), ("sign", 0.4, 0.6, 12), ("tree", 2.5, 38.0, 420),
)  # fmt: skip
"""Kinds of scenery, how near and far they are from the edge of the pavement [m], and how many there are at most."""

Row = tuple[tuple[float, ...], tuple[int, int, int, int]]


def fixtures(world: World, terrain: Terrain, seed: int, *, has_scenery: bool) -> tuple[Float32, Int32]:
    """Return the fixtures of a world, see ``cameras.draw.structures.Solids``.

    Args:
        world: The world.
        terrain: Its ground.
        seed: Seed of the scenery.
        has_scenery: Whether there are buildings, trees and lamps; traffic lights always are.
    """
    rows = _traffic_lights(world, terrain)
    if has_scenery:
        rows += _scenery(world, terrain, seed)
    places = np.array([place for place, _ in rows], np.float32).reshape(-1, 7)
    kinds = np.array([kind for _, kind in rows], np.int32).reshape(-1, 4)
    if world.heights is not None and len(places):
        places[:, 2] += world.heights.at(places[:, :2].astype(np.float64))
    return places, kinds


def _traffic_lights(world: World, terrain: Terrain) -> list[Row]:
    rows: list[Row] = []
    feet: list[tuple[Float64, float]] = []
    recorded = world.log_position[world.log_valid][::5].astype(np.float64)
    taken = terrain.road.buffer(0.4).union(shapely.multipoints(recorded).buffer(1.5, quad_segs=1))
    shapely.prepare(taken)
    for light, (stop, lane) in enumerate(zip(world.light_stop.astype(np.float64), world.light_lane, strict=True)):
        if not np.isfinite(stop).all():
            continue
        points = world.roads.lanes[int(lane)] if lane >= 0 else np.zeros((0, 2))
        heading = _heading_at(points.astype(np.float64), stop)
        head = (*stop, LIGHT_HEIGHT, heading, 0.35, 0.40, 1.05)
        rows.append((head, (at.LIGHT_HEAD, at.TRAFFIC_LIGHT, _DARK_PAINT, light)))
        right = np.array([np.sin(heading), -np.cos(heading)])
        free = stop + _MAST_PLACES[:, None] * right
        free = free[~shapely.contains_xy(taken, free)]
        if not len(free):
            continue  # hangs from wires
        shared = [foot for foot, its in feet if np.cos(its - heading) > 0.8 and np.hypot(*(foot - free[0])) < 4.0]
        foot = shared[0] if shared else free[0]
        if not shared:
            feet.append((foot, heading))
            mast = (*foot, 0.0, heading, 0.22, 0.22, LIGHT_HEIGHT + 0.9)
            low = (*(foot - 0.28 * right), 2.4, heading, 0.30, 0.34, 0.9)
            rows.append((mast, (at.POLE, at.POLE_CLASS, _DARK_PAINT, -1)))
            rows.append((low, (at.LIGHT_HEAD, at.TRAFFIC_LIGHT, _DARK_PAINT, light)))
        reach = stop - foot
        turn = float(np.arctan2(reach[1], reach[0])) - np.pi / 2
        arm = (*(foot + 0.5 * reach), LIGHT_HEIGHT + 0.72, turn, 0.10, float(np.hypot(*reach)), 0.10)
        rows.append((arm, (at.BOX, at.POLE_CLASS, _DARK_PAINT, -1)))
    return rows


def _heading_at(points: Float64, place: Float64) -> float:
    """Return the heading of a line [rad] at the point nearest to a place; 0 without one."""
    if len(points) < 2:
        return 0.0
    nearest = min(int(np.argmin(np.hypot(*(points - place).T))), len(points) - 2)
    ahead = points[nearest + 1] - points[nearest]
    return float(np.arctan2(ahead[1], ahead[0]))


def _scenery(world: World, terrain: Terrain, seed: int) -> list[Row]:
    rng = np.random.default_rng([seed, zlib.crc32(world.scenario_id.encode())])
    driven = world.log_position[world.log_valid[:, world.ego], world.ego][::10].astype(np.float64)
    every = world.log_position[world.log_valid][::20].astype(np.float64)
    taken = shapely.union(terrain.paved, shapely.multipoints(every).buffer(2.0, quad_segs=1))
    shapely.prepare(taken)
    path = shapely.MultiPoint(driven)
    rows: list[Row] = []
    placed = [shapely.Point(-1e9, -1e9)]
    for kind, near, far, count in _SCENERY:
        for spot in _spots(terrain, path, near, far, count * 2, rng):
            if len(rows) >= _MOST or count == 0:
                break
            left = spot[0] - 4.5 * np.sin(spot[2]), spot[1] + 4.5 * np.cos(spot[2])
            if kind == "sign" and not shapely.contains_xy(terrain.road, *left):
                spot = (*spot[:2], spot[2] + np.pi)  # faces those who drive on this side
            made = _made(kind, spot, rng)
            (x, y, _, heading, length, width, _), _ = made
            outline = shapely.affinity.translate(
                shapely.affinity.rotate(
                    shapely.box(-length / 2, -width / 2, length / 2, width / 2), heading, use_radians=True
                ), x, y,
            )  # fmt: skip
            trunk = outline if kind == "building" else outline.buffer(-0.4 * width)
            tree = shapely.STRtree(placed)
            if shapely.intersects(taken, trunk) or len(tree.query(outline, predicate="intersects")):
                continue
            placed.append(outline)
            rows.append(made)
            count -= 1
    return rows


def _spots(
    terrain: Terrain, path: shapely.Geometry, near: float, far: float, count: int, rng: np.random.Generator
) -> list[tuple[float, float, float]]:
    """Return random places beside the road, near the path, with the heading of the road there."""
    outline = terrain.paved.boundary.intersection(path.buffer(_REACH, quad_segs=4))
    if outline.is_empty or outline.length < 1.0:
        low, high = np.array(path.bounds[:2]) - 80.0, np.array(path.bounds[2:]) + 80.0
        return [(*rng.uniform(low, high), 0.0) for _ in range(count // 4)]
    line = shapely.line_merge(outline) if outline.geom_type == "MultiLineString" else outline
    parts = [part for part in shapely.get_parts(line) if part.geom_type in ("LineString", "LinearRing")]
    lengths = np.array([part.length for part in parts])
    found = []
    for part in rng.choice(len(parts), count, p=lengths / lengths.sum()):
        along = rng.uniform(0.0, lengths[part])
        first = shapely.get_coordinates(parts[part].interpolate(along))[0]
        last = shapely.get_coordinates(parts[part].interpolate(min(along + 0.5, lengths[part])))[0]
        heading = float(np.arctan2(last[1] - first[1], last[0] - first[0]))
        offset = rng.uniform(near, far) * rng.choice([-1.0, 1.0])
        found.append((first[0] - offset * np.sin(heading), first[1] + offset * np.cos(heading), heading))
    return found


def _made(kind: str, spot: tuple[float, float, float], rng: np.random.Generator) -> Row:
    x, y, heading = spot
    if kind == "building":
        length, width, height = rng.uniform(10, 24), rng.uniform(9, 15), rng.choice([4, 7, 7, 10, 13, 20, 27])
        place = (x, y, -FOUNDATION, heading, length, width, float(height))
        return place, (at.BUILDING, at.BUILDING_CLASS, 20 + int(rng.integers(6)), -1)
    if kind == "lamp":
        return (x, y, 0.0, heading, 2.6, 2.6, 7.5), (at.LAMP, at.POLE_CLASS, _LIGHT_PAINT, -1)
    if kind == "sign":
        return (x, y, 0.0, heading, 0.3, 0.7, 2.9), (at.SIGN, at.SIGN_CLASS, int(rng.choice([3, 3, 10])), -1)
    mesh = at.CONIFER if rng.random() < 0.25 else at.TREE
    wide = rng.uniform(3.2, 6.5)
    tall = wide * rng.uniform(1.2, 1.7) if mesh == at.TREE else wide * rng.uniform(1.9, 2.6)
    return (x, y, 0.0, rng.uniform(0, 6.28), wide, wide, tall), (mesh, at.VEGETATION, 16 + int(rng.integers(4)), -1)
