"""What is nearest to an agent, as rows of numbers in its frame: other objects, and pieces of the road."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Int32
from scenarionet_data.compiled.decorators import device_function
from scenarionet_sim.arrays.boxes import Boxes, X, Y, rotation
from scenarionet_sim.arrays.log import HEADING, VX, VY
from scenarionet_sim.arrays.minmax import larger, smaller
from scenarionet_sim.arrays.structures import PIECE_CELLS, Lines, StateArrays

OF_OBJECT, OF_PIECE = 13, 8
"""Numbers of an object and of a piece."""


class NearMemory(NamedTuple):
    """Memory for what is in reach of one agent.

    Attributes:
        apart: (M,) squared distances [m²].
        row: (M,) their rows.
        order: (M,) their places by distance.
    """

    apart: Float32
    row: Int32
    order: Int32

    @classmethod
    def of(cls, most: int) -> NearMemory:
        """Allocate the memory for up to M objects or pieces."""
        return cls(np.empty(most, np.float32), np.empty(most, np.int32), np.empty(most, np.int32))


@device_function(in_lanes=True)
def nearest_objects(
    w: int, own: int, now: StateArrays, boxes: Boxes, types: Bool, scale: Float64, memory: NearMemory, out: Float32
) -> None:
    """Observe the objects nearest to an agent, nearest first; ties in the order of their rows.

    Args:
        w, own: World and row of the agent.
        now: Current state.
        boxes: Boxes of its world.
        types: (256,) visible types.
        scale: Range [m]; factors of distances, speeds and sizes.
        memory: Written.
        out: (K * 13,) output, see ``Surrounding``.
    """
    motion, numbers = now.motion[w], boxes.numbers
    me, reach, seen = motion[own], scale[0], 0
    for b in range(boxes.num_boxes[0]):
        dx, dy, n = numbers[X, b] - me[X], numbers[Y, b] - me[Y], boxes.row[b]
        apart = dx * dx + dy * dy
        memory.apart[seen], memory.row[seen] = apart, b
        seen += (apart <= reach * reach) & (n != own) & types[now.object_type[w, n]]
    _rank(seen, memory.apart, memory.order)
    most, cos, sin = len(out) // OF_OBJECT, np.cos(me[HEADING]), np.sin(me[HEADING])
    for k in range(seen):
        at, b = memory.order[k] * OF_OBJECT, memory.row[k]
        if at >= len(out):
            continue
        n, (cos_box, sin_box) = boxes.row[b], rotation(b, motion, boxes)
        dx, dy = numbers[X, b] - me[X], numbers[Y, b] - me[Y]
        vx, vy = motion[n, VX] - me[VX], motion[n, VY] - me[VY]
        out[at] = 1.0
        out[at + 1], out[at + 2] = _scaled(cos * dx + sin * dy, scale[1]), _scaled(cos * dy - sin * dx, scale[1])
        out[at + 3], out[at + 4] = cos * cos_box + sin * sin_box, cos * sin_box - sin * cos_box
        out[at + 5], out[at + 6] = _scaled(cos * vx + sin * vy, scale[2]), _scaled(cos * vy - sin * vx, scale[2])
        for axis in range(3):
            out[at + 7 + axis] = _scaled(now.size[w, n, axis], scale[3])
            out[at + 10 + axis] = now.object_type[w, n] == 1 + axis
    _clear(smaller(seen, most) * OF_OBJECT, out)


@device_function(forceinline=True)
def _scaled(value: float, factor: float) -> float:
    """Multiply and limit to [-1, 1]."""
    return smaller(larger(value * factor, -1.0), 1.0)


@device_function(in_lanes=True)
def _rank(count: int, apart: Float32, order: Int32) -> None:
    """Count for each of the first distances how many come before it: fewer than 100 are not worth a sort."""
    for k in range(count):
        before = 0
        for m in range(k):
            before += apart[m] <= apart[k]
        for m in range(k + 1, count):
            before += apart[m] < apart[k]
        order[k] = before


@device_function
def nearest_pieces(w: int, me: Float64, lines: Lines, reach: float, memory: NearMemory, out: Float32) -> None:
    """Observe the pieces of the road whose midpoints are nearest to an agent, in the order of the map.

    Args:
        w: World of the agent.
        me: (7,) its row of motion.
        lines: Maps.
        reach: Largest distance of a midpoint [m].
        memory: Written.
        out: (K * 8,) output, see ``RoadSegments``.
    """
    frame, cells = lines.frame[w, 5:], lines.place[w, PIECE_CELLS]
    columns, rows, seen, most = int(frame[3]), int(frame[4]), 0, len(out) // OF_PIECE
    x, y = (me[X] - frame[0]) / frame[2], (me[Y] - frame[1]) / frame[2]  # in cells, as all that follows
    radius = reach / frame[2]
    apart, row_of, order, limit = memory.apart, memory.row, memory.order, np.float32(reach * reach)
    east, north = np.float32(me[X]), np.float32(me[Y])
    for row in range(larger(int(np.floor(y - radius)), 0), smaller(int(np.floor(y + radius)), rows - 1) + 1):
        away = larger(larger(row - y, y - row - 1.0), 0.0)
        half = np.sqrt(larger(radius * radius - away * away, 0.0))
        first = cells + row * columns + larger(int(np.floor(x - half)), 0)
        last = cells + row * columns + smaller(int(np.floor(x + half)), columns - 1)
        if first <= last:
            span = lines.piece_start[first], lines.piece_start[last + 1]
            seen = _add_in_reach(span, east, north, limit, lines.pieces, apart, row_of, seen)
    chosen = seen
    if seen > most:
        below, up_to = _split(seen, most, limit, apart)
        chosen = _choose(seen, np.float32(-1.0), below, 0, apart, row_of, order)
        if below < up_to:
            chosen = smaller(_choose(seen, below, up_to, chosen, apart, row_of, order), most)
    _write(chosen, me, 1.0 / reach, order if seen > most else row_of, lines.pieces, out)
    _clear(chosen * OF_PIECE, out)


@device_function(in_lanes=True)
def _add_in_reach(
    span: tuple[int, int],
    x: np.float32,
    y: np.float32,
    limit: np.float32,
    pieces: Float32,
    apart: Float32,
    row: Int32,
    seen: int,
) -> int:
    """Append the pieces of a row of cells whose squared distance is in a limit; return how many there are then."""
    for piece in range(span[0], span[1]):
        dx, dy = pieces[piece, 0] - x, pieces[piece, 1] - y
        distance = dx * dx + dy * dy
        apart[seen], row[seen] = distance, piece
        seen += distance <= limit
    return seen


@device_function
def _split(count: int, most: int, limit: np.float32, apart: Float32) -> tuple[np.float32, np.float32]:
    """Return where to split distances, more than ``most``: twice the distance below which there are exactly ``most``.

    Where several are equally far, fewer than ``most`` are below the first, and more below the second with these alone
    in between. The number below a distance grows about as its square does, so a line between known ones guesses well.
    """
    low, high, below_low, below_high = np.float32(0.0), np.float32(limit * 1.001), 0, count
    for turn in range(64):
        share = (most + 0.5 - below_low) / (below_high - below_low) if turn % 4 < 3 else 0.5
        guess = np.float32(low + (high - low) * share)
        if guess <= low or guess >= high:
            guess = np.float32(0.5 * (low + high))
            if guess <= low or guess >= high:
                break
        below = _below(count, guess, apart)
        if below == most:
            return guess, guess
        if below < most:
            low, below_low = guess, below
        else:
            high, below_high = guess, below
    return low, high


@device_function(in_lanes=True)
def _below(count: int, limit: np.float32, apart: Float32) -> int:
    """Count the first distances below a limit."""
    below = 0
    for k in range(count):
        below += apart[k] < limit
    return below


@device_function(in_lanes=True)
def _choose(seen: int, low: np.float32, high: np.float32, chosen: int, apart: Float32, row: Int32, order: Int32) -> int:
    """Append the pieces from one distance up to another to the order; return how many there are then."""
    for k in range(seen):
        order[chosen] = row[k]
        chosen += (apart[k] >= low) & (apart[k] < high)
    return chosen


@device_function(in_lanes=True)
def _clear(first: int, out: Float32) -> None:
    """Write zeros from an element on."""
    for at in range(first, len(out)):
        out[at] = 0.0


@device_function
def _write(count: int, me: Float64, factor: float, order: Int32, pieces: Float32, out: Float32) -> None:
    """Write pieces, turned into the frame of an agent."""
    x, y, share = np.float32(me[X]), np.float32(me[Y]), np.float32(factor)
    cos, sin = np.float32(np.cos(me[HEADING])), np.float32(np.sin(me[HEADING]))
    for k in range(count):
        piece, at = order[k], k * OF_PIECE
        dx, dy = (pieces[piece, 0] - x) * share, (pieces[piece, 1] - y) * share
        along, across = pieces[piece, 3], pieces[piece, 4]
        out[at], out[at + 1] = cos * dx + sin * dy, cos * dy - sin * dx
        out[at + 2] = pieces[piece, 2]
        out[at + 3], out[at + 4] = cos * along + sin * across, cos * across - sin * along
        out[at + 5], out[at + 6], out[at + 7] = pieces[piece, 5], pieces[piece, 6], pieces[piece, 7]
