"""Road blocks without crossing traffic: straight, curve, fork, merge, on-ramp and off-ramp."""

from __future__ import annotations

import math

import numpy as np

from scenarionet_data.procedural.path import Pose, RoadPath, bend
from scenarionet_data.procedural.roadmap import Block, Lane, Socket
from scenarionet_data.procedural.sections import EDGE, add_narrowing, add_road, add_widening, strip

TAPER = 25.0  # [m] over which a lane opens or closes
RAMP_LANE = (40.0, 60.0)  # [m] shortest and longest acceleration or deceleration lane


def straight(block: Block, socket: Socket, rng: np.random.Generator) -> None:
    """Add a straight road."""
    block.exit = add_road(block, "", socket, ((rng.uniform(20.0, 130.0), 0.0),))


def curve(block: Block, socket: Socket, rng: np.random.Generator) -> None:
    """Add a bend to the left or right between two short straight sections."""
    radius = rng.uniform(30.0, 90.0)
    turn = rng.uniform(0.3, min(1.9, 130.0 / radius)) * rng.choice([-1.0, 1.0])
    pieces = ((rng.uniform(5.0, 15.0), 0.0), bend(turn, radius), (rng.uniform(5.0, 15.0), 0.0))
    block.exit = add_road(block, "", socket, pieces)


def fork(block: Block, socket: Socket, rng: np.random.Generator) -> None:
    """Split the rightmost lane: the road continues with one more lane."""
    before = add_road(block, "a", socket, ((rng.uniform(5.0, 30.0), 0.0),))
    wide = add_widening(block, "b", before, TAPER)
    block.exit = add_road(block, "c", wide, ((rng.uniform(10.0, 60.0), 0.0),))


def merge(block: Block, socket: Socket, rng: np.random.Generator) -> None:
    """End the rightmost lane: the road continues with one lane fewer."""
    before = add_road(block, "a", socket, ((rng.uniform(40.0, 60.0), 0.0),))
    narrow = add_narrowing(block, "b", before, TAPER, block.index)
    block.exit = add_road(block, "c", narrow, ((rng.uniform(5.0, 30.0), 0.0),))


def on_ramp(block: Block, socket: Socket, rng: np.random.Generator) -> None:
    """Add a ramp that joins from the right through an acceleration lane."""
    before = add_road(block, "a", socket, ((rng.uniform(15.0, 30.0), 0.0),))
    joint = _ramp_joint(block, before)
    turn, radius = rng.uniform(0.35, 0.6), rng.uniform(45.0, 70.0)
    away = RoadPath(joint.moved(0.0, 0.0, math.pi), (bend(turn, radius), (rng.uniform(25.0, 40.0), 0.0)))
    ramp = _add_ramp(block, away.reversed())
    wide = Socket(before.pose, (*before.forward, (ramp.id,)), before.backward)
    beside = add_road(block, "b", wide, ((rng.uniform(*RAMP_LANE), 0.0),))
    narrow = add_narrowing(block, "c", beside, TAPER, block.index)
    block.exit = add_road(block, "d", narrow, ((10.0, 0.0),))


def off_ramp(block: Block, socket: Socket, rng: np.random.Generator) -> None:
    """Add a deceleration lane on the right that leaves the road by a ramp."""
    before = add_road(block, "a", socket, ((rng.uniform(10.0, 20.0), 0.0),))
    wide = add_widening(block, "b", before, TAPER)
    beside = add_road(block, "c", wide, ((rng.uniform(*RAMP_LANE), 0.0),))
    main = Socket(beside.pose, beside.forward[:-1], beside.backward)
    turn, radius = rng.uniform(0.35, 0.6), rng.uniform(45.0, 70.0)
    away = RoadPath(_ramp_joint(block, main), (bend(-turn, radius), (rng.uniform(25.0, 40.0), 0.0)))
    ramp = _add_ramp(block, away)
    block.link(beside.forward[-1], (ramp.id,))
    block.exit = add_road(block, "d", main, ((rng.uniform(20.0, 35.0), 0.0),))


def _ramp_joint(block: Block, main: Socket) -> Pose:
    """Pose on the centreline of a lane to the right of the road's lanes, heading along the road."""
    return main.pose.moved(0.0, -(len(main.forward) + 0.5) * block.road.lane_width)


def _add_ramp(block: Block, path: RoadPath) -> Lane:
    half = block.road.lane_width / 2.0
    sides = {side: block.add_line(f"ramp{side}", EDGE, path.offset(d)) for side, d in (("l", half), ("r", -half))}
    block.footprint.append(strip(path, half, half))
    return block.add_lane("ramp", path, left_boundaries=(sides["l"],), right_boundaries=(sides["r"],))
