"""Intersections of four roads and of three (T): turning lanes, crosswalks, stop lines, curb returns, lights.

Arms are numbered counter-clockwise from the one the ego arrives on, so that leaving by arm 1 is a right turn,
by arm 2 straight on and by arm 3 a left turn.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from shapely import Polygon

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.procedural.path import Pose, connect, turn_around
from scenarionet_data.procedural.roadmap import Block, Lane, Socket
from scenarionet_data.procedural.sections import EDGE, add_road
from scenarionet_data.scenario.vocabulary import MapFeatureType

CORNER = 8.0  # [m] radius of a curb return
LEAD = 5.5  # [m] from the stop line to where turning starts: room for the crosswalk
LEAD_BACK, TIGHTEST = 8.0, 5.0  # [m] the same, and the least radius, for those who turn around
CROSSWALK = (1.5, 4.5)  # [m] a crosswalk's near and far side, from the stop line


@dataclass(frozen=True)
class Arm:
    """One road of an intersection.

    Attributes:
        number: 0 to 3.
        pose: On the road's reference line at its stop line, heading away from the intersection.
        num_in, num_out: Lanes towards the intersection and away from it.
    """

    number: int
    pose: Pose
    num_in: int
    num_out: int


@dataclass(frozen=True)
class Turn:
    """A turning lane from a lane of one arm to a lane of another."""

    start: int
    start_lane: int
    end: int
    end_lane: int
    lane: Lane


def intersection(block: Block, socket: Socket, rng: np.random.Generator, has_lights: bool) -> None:
    """Add a crossing of four roads; the ego leaves by any of the other three."""
    _cross(block, socket, rng, arms=(0, 1, 2, 3), leave=int(rng.integers(1, 4)), has_lights=has_lights)


def u_turn(block: Block, socket: Socket, rng: np.random.Generator, has_lights: bool) -> None:
    """Add a crossing of four roads on which traffic may turn around; the ego leaves by any of the other three."""
    leave = int(rng.integers(1, 4))
    _cross(block, socket, rng, arms=(0, 1, 2, 3), leave=leave, has_lights=has_lights, turns_around=True)


def t_intersection(block: Block, socket: Socket, rng: np.random.Generator, has_lights: bool) -> None:
    """Add a junction of three roads; the missing arm and the arm the ego leaves by are random."""
    missing = int(rng.integers(1, 4))
    arms = tuple(arm for arm in range(4) if arm != missing)
    _cross(block, socket, rng, arms=arms, leave=int(rng.choice(arms[1:])), has_lights=has_lights)


def _cross(block: Block, socket: Socket, rng: np.random.Generator, *, arms: tuple[int, ...], **how: Any) -> None:
    approach = add_road(block, "a", socket, ((rng.uniform(25.0, 55.0), 0.0),))
    side = int(rng.integers(1, len(socket.forward) + 1))
    cross(block, approach, arms, side, lambda: rng.uniform(25.0, 60.0), **how)


def cross(
    block: Block,
    approach: Socket,
    arms: tuple[int, ...],
    side: int,
    length: Callable[[], float],
    *,
    leave: int = 2,
    has_lights: bool = False,
    turns_around: bool = False,
) -> None:
    """Add a crossing to the end of a road.

    Args:
        block: Gets the lanes, lines and areas.
        approach: The end of the road, which is arm 0.
        arms: Numbers of the arms.
        side: Lanes of arms 1 and 3 in each direction.
        length: Returns the length of the next arm [m].
        leave: The arm that is the exit of the block.
        has_lights: Whether lights control it.
        turns_around: Whether leftmost lanes lead back as well; it needs all four arms.
    """
    placed = _place_arms(block, approach, arms, side)
    # The through road, the ego's (0) or the other (1), has priority at junctions without lights.
    through = 0 if {0, 2} <= {arm.number for arm in placed} else 1
    # Those who turn around leave by the outermost lane for which they need not swing out, or by the leftmost.
    turns = [
        _add_turn(block, start, i, end, j, has_lights, through)
        for start in placed
        for i in range(start.num_in)
        for end, j in _targets(start, i, placed) + [(start, min(start.num_out - 1, 2))] * (turns_around and i == 0)
    ]
    for turn in turns:
        if turn.start == 0:
            block.link(approach.forward[turn.start_lane], (turn.lane.id,))
        if turn.end == 0:
            block.link((turn.lane.id,), approach.backward[turn.end_lane])
    for arm in placed[1:]:
        end = add_road(block, f"arm{arm.number}", _open(arm, turns), ((length(), 0.0),))
        if arm.number == leave:
            block.exit = end
    _add_surface(block, placed, turns)


def _open(arm: Arm, turns: list[Turn]) -> Socket:
    """The socket at an arm's stop line."""

    def ending(j: int) -> tuple[str, ...]:
        return tuple(turn.lane.id for turn in turns if (turn.end, turn.end_lane) == (arm.number, j))

    def starting(i: int) -> tuple[str, ...]:
        return tuple(turn.lane.id for turn in turns if (turn.start, turn.start_lane) == (arm.number, i))

    return Socket(arm.pose, tuple(map(ending, range(arm.num_out))), tuple(map(starting, range(arm.num_in))))


def _place_arms(block: Block, approach: Socket, numbers: tuple[int, ...], side: int) -> list[Arm]:
    """Place the arms around a centre, far enough out for the corners between them."""
    width = block.road.lane_width
    num_in, num_out = len(approach.forward), len(approach.backward)
    out_main = side * width + CORNER + LEAD
    out_side = max(num_in, num_out) * width + CORNER + LEAD
    centre = approach.pose.moved(out_main, 0.0)
    arms = []
    for number in numbers:
        outwards = Pose(centre.x, centre.y, approach.pose.heading + math.pi + number * math.pi / 2.0)
        pose = outwards.moved(out_main if number % 2 == 0 else out_side, 0.0)
        lanes = ((num_in, num_out), (side, side), (num_out, num_in), (side, side))[number]
        arms.append(Arm(number, pose, *lanes))
    return arms


def _targets(start: Arm, i: int, arms: list[Arm]) -> list[tuple[Arm, int]]:
    """Permitted targets of lane ``i`` of an arm: left from the leftmost, right from the rightmost, straight from all.

    A middle lane that cannot go straight on turns left, next to the leftmost.
    """
    targets = []
    for end in arms:
        turn = (end.number - start.number) % 4
        right, straight, left = turn == 1, turn == 2, turn == 3
        if right and i == start.num_in - 1:
            targets.append((end, end.num_out - 1))
        elif (left and i == 0) or (straight and i < end.num_out):
            targets.append((end, i))
    if not targets:
        end = next(arm for arm in arms if (arm.number - start.number) % 4 == 3)
        targets.append((end, min(i, end.num_out - 1)))
    return targets


def _add_turn(block: Block, start: Arm, i: int, end: Arm, j: int, has_lights: bool, through: int) -> Turn:
    width = block.road.lane_width
    first = start.pose.moved(0.0, (i + 0.5) * width, math.pi)
    last = end.pose.moved(0.0, -(j + 0.5) * width)
    rank = {0: 0, 1: 1, 2: 2, 3: 0}[(end.number - start.number) % 4]
    if not has_lights and start.number % 2 == through:
        rank += 3
    lane = block.add_lane(
        f"x{start.number}{i}-{end.number}{j}",
        turn_around(first, last, LEAD_BACK, TIGHTEST) if start is end else connect(first, last, LEAD),
        junction=block.index,
        rank=rank,
        axis=start.number % 2 if has_lights else -1,
        is_intersection=True,
    )
    return Turn(start.number, i, end.number, j, lane)


def _add_surface(block: Block, arms: list[Arm], turns: list[Turn]) -> None:
    """Add curb returns and the intersection's outline between them."""
    width = block.road.lane_width
    outline = []
    for arm, following in zip(arms, [*arms[1:], arms[0]], strict=True):
        _add_crossing(block, arm, tuple(turn.lane.id for turn in turns if turn.start == arm.number))
        first = arm.pose.moved(0.0, arm.num_in * width, math.pi)
        curb = connect(first, following.pose.moved(0.0, -following.num_out * width), LEAD)
        curb_id = block.add_line(f"curb{arm.number}", EDGE, curb)
        outermost = (arm.number, arm.num_in - 1, following.number, following.num_out - 1)
        for turn in turns:
            if (turn.start, turn.start_lane, turn.end, turn.end_lane) == outermost:
                turn.lane.right_boundaries = (curb_id,)
        outline.append(curb.sample(2.0)[0])
    shape = np.concatenate(outline)
    block.add_area("box", MapFeatureType.INTERSECTION, shape)
    block.footprint.append(Polygon(shape))


def _add_crossing(block: Block, arm: Arm, controlled: tuple[str, ...]) -> None:
    """Add an arm's stop line and crosswalk."""
    left, right = arm.num_in * block.road.lane_width, -arm.num_out * block.road.lane_width
    stop = _points(arm.pose, [(0.5, left), (0.5, 0.0)])
    block.add_line(f"stop{arm.number}", MapFeatureType.STOP_LINE, stop, controlled)
    near, far = CROSSWALK
    corners = [(-near, left), (-near, right), (-far, right), (-far, left)]
    block.add_area(f"walk{arm.number}", MapFeatureType.CROSSWALK, _points(arm.pose, corners), controlled)


def _points(pose: Pose, places: list[tuple[float, float]]) -> Float64:
    """(n, 2) points from offsets ahead and to the left of a pose."""
    moved = [pose.moved(*place) for place in places]
    return np.array([(point.x, point.y) for point in moved])
