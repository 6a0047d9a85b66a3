"""Compiled loops from blocks of scenarios to the polylines of samples, in their frames.

B samples, L polylines of N points.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Int32, Int64
from scenarionet_data.compiled.decorators import device_function, kernel
from scenarionet_data.samples.kernels import sort
from scenarionet_data.samples.scene_kernels import NUM_PIECES, PIECES, POINTS, SceneMemory

NUM_FEATURES = 4
X, Y, DIRECTION_X, DIRECTION_Y = range(NUM_FEATURES)
"""Features of a point, in the sample's frame."""

_NUM_BINS = 1024
_TOGETHER = 16
"""Pieces whose points are moved in one loop: the compiler moves several points at once."""


class PolylineArrays(NamedTuple):
    """Arrays that are filled."""

    points: Float32  # (B, L * N * 4)
    valid: Bool  # (B, L * N)
    kind: Int32  # (B, L)


class _Pieces(NamedTuple):
    """The map of a scenario: P pieces."""

    points: Float32  # (P * 2 * N,) [m] x of all points of a piece, then y
    first_x: Float32  # (P,) of its first point
    first_y: Float32
    lengths: Int32  # (P,) number of points
    kinds: Int32  # (P,) MapFeatureType


class _Near(NamedTuple):
    """Pieces near a sample, by distance from its centre: scratch memory."""

    pieces: Int64  # in the order of the map
    distances: Float32  # (P,) squares of those of their nearest points [m^2]
    order: Int64
    bins: Int32
    squares: Float32  # (N,) of the points of one piece
    bits: Int32  # (N,) the same memory


class _Lines(NamedTuple):
    """Points of some of a sample's polylines, one after the other: scratch memory."""

    x: Float32  # (_TOGETHER * N,) in the frame of the scenario
    y: Float32
    own_x: Float32  # in that of the sample
    own_y: Float32
    direction_x: Float32
    direction_y: Float32


@kernel(nogil=True, divides_by_zero=True)
def fill_polylines(
    memory: SceneMemory, blocks: Int64, pose: Float64, spacing: float, radius: float, out: PolylineArrays
) -> None:
    """Fill in the pieces nearest to the centre of each sample, in its frame.

    Args:
        memory: Blocks of scenarios.
        blocks: (B,) place of the scenario's block [words]; -1 for samples that are left out.
        pose: (B, 4) see ``AgentArrays``.
        spacing: Largest distance between points of a piece [m].
        radius: Largest distance of a piece's nearest point from the centre [m].
        out: Filled.
    """
    num_lines, longest = out.kind.shape[1], 0
    points = out.valid.shape[1] // num_lines
    for block in blocks:
        if block >= 0:
            longest = max(longest, memory.ints[block + NUM_PIECES])
    squares = np.empty(points, np.float32)
    near = _Near(
        np.empty(longest, np.int64),
        np.empty(longest, np.float32),
        np.empty(longest, np.int64),
        np.empty(_NUM_BINS + 1, np.int32),
        squares,
        squares.view(np.int32),
    )
    room = _TOGETHER * points
    lines = _Lines(
        np.empty(room, np.float32),
        np.empty(room, np.float32),
        np.empty(room, np.float32),
        np.empty(room, np.float32),
        np.empty(room, np.float32),
        np.empty(room, np.float32),
    )
    for sample in range(len(blocks)):
        block = blocks[sample]
        if block < 0:
            continue
        count = 0
        pieces = _pieces(memory, block, points)
        if not np.isnan(pose[sample, 0]):
            found = _find_near(pieces, np.float32(pose[sample, 0]), np.float32(pose[sample, 1]), spacing, radius, near)
            _sort(near, found)
            count = min(found, num_lines)
        for first in range(0, count, _TOGETHER):
            end = min(first + _TOGETHER, count)
            _move(pieces, near.pieces, near.order[first:end], pose[sample], lines)
            _write(pieces, near.pieces, near.order[first:end], lines, (sample, first), out)
        out.points[sample, NUM_FEATURES * points * count :], out.valid[sample, points * count :] = 0.0, False
        out.kind[sample, count:] = 0


@device_function(allocates=True, divides_by_zero=True)
def _pieces(memory: SceneMemory, block: int, points: int) -> _Pieces:
    """The pieces of a block."""
    count = np.int64(memory.ints[block + NUM_PIECES])
    first, at = block + memory.ints[block + PIECES], block + memory.ints[block + POINTS]
    return _Pieces(
        memory.floats[at : at + count * 2 * points],
        memory.floats[first + 2 * count : first + 3 * count],
        memory.floats[first + 3 * count : first + 4 * count],
        memory.ints[first : first + count],
        memory.ints[first + count : first + 2 * count],
    )


@device_function(divides_by_zero=True)
def _find_near(pieces: _Pieces, x: Any, y: Any, spacing: float, radius: float, near: _Near) -> int:
    """Collect the pieces that have a point within the radius, with the distance of the nearest one."""
    found, points = 0, len(near.squares)
    beyond = radius + spacing * (points - 1)
    for piece in range(len(pieces.lengths)):
        aside, ahead = pieces.first_x[piece] - x, pieces.first_y[piece] - y
        if aside * aside + ahead * ahead > beyond * beyond:  # and its other points are outside of the radius
            continue
        _measure(pieces.points[2 * piece * points : 2 * (piece + 1) * points], x, y, near.squares)
        nearest = near.bits[0]  # numbers of at least 0 are in the order of their bits, and integers compared at once
        for point in range(1, points):
            nearest = min(nearest, near.bits[point])
        near.bits[0] = nearest
        if near.squares[0] <= radius * radius:
            near.pieces[found], near.distances[found] = piece, near.squares[0]
            found += 1
    return found


@device_function(divides_by_zero=True, in_lanes=True)
def _measure(line: Float32, x: Any, y: Any, squares: Float32) -> None:
    """Squares of the distances of a piece's points."""
    points = len(squares)
    for point in range(points):
        aside, ahead = line[point] - x, line[points + point] - y
        squares[point] = aside * aside + ahead * ahead


@device_function(divides_by_zero=True)
def _sort(near: _Near, count: int) -> None:
    """Fill in the order of the pieces by distance; equal ones stay: into bins, of which each is sorted."""
    farthest = np.float32(0.0)
    for number in range(count):
        farthest = max(farthest, near.distances[number])
    scale = np.float32(_NUM_BINS - 1) / farthest if farthest > 0.0 else np.float32(0.0)
    near.bins[:] = 0
    for number in range(count):
        near.bins[int(near.distances[number] * scale) + 1] += 1
    for number in range(_NUM_BINS):
        near.bins[number + 1] += near.bins[number]
    for number in range(count):
        place = int(near.distances[number] * scale)
        near.order[near.bins[place]] = number
        near.bins[place] += 1
    sort(near.distances, near.order, count)


@device_function(divides_by_zero=True)
def _move(pieces: _Pieces, near: Int64, order: Int64, pose: Float64, lines: _Lines) -> None:
    """Move the points of some pieces to the sample's frame, with the direction from each to the next one."""
    count = len(order) * (len(lines.x) // _TOGETHER)
    _gather(pieces.points, near, order, lines.x, lines.y)
    cos, sin = np.float32(np.cos(pose[2])), np.float32(np.sin(pose[2]))
    frame = np.float32(pose[0]), np.float32(pose[1]), cos, sin, np.float32(pose[3])
    _turn(lines.x[:count], lines.y[:count], frame, lines.own_x, lines.own_y)
    x, y = lines.own_x[:count], lines.own_y[:count]  # also from one piece to the next one, which is overwritten
    _direct(x, y, x[1:], y[1:], lines.direction_x, lines.direction_y)


@device_function(divides_by_zero=True, in_lanes=True)
def _gather(points: Float32, near: Int64, order: Int64, x: Float32, y: Float32) -> None:
    """Join the points of some pieces."""
    count = len(x) // _TOGETHER
    for place in range(len(order)):
        first, to = 2 * near[order[place]] * count, place * count
        for point in range(count):
            x[to + point], y[to + point] = points[first + point], points[first + count + point]


@device_function(divides_by_zero=True, in_lanes=True)
def _turn(x: Float32, y: Float32, frame: tuple[Any, Any, Any, Any, Any], own_x: Float32, own_y: Float32) -> None:
    """Move points to a frame: its origin, cos and sin of its heading, and -1 if it is mirrored, else 1."""
    origin_x, origin_y, cos, sin, mirror = frame
    for point in range(len(x)):
        ahead, aside = x[point] - origin_x, y[point] - origin_y
        own_x[point], own_y[point] = cos * ahead + sin * aside, mirror * (cos * aside - sin * ahead)


@device_function(divides_by_zero=True, in_lanes=True)
def _direct(x: Float32, y: Float32, next_x: Float32, next_y: Float32, to_x: Float32, to_y: Float32) -> None:
    """Directions from points to the next ones; 0 where these are the same."""
    for point in range(len(next_x)):
        ahead, aside = next_x[point] - x[point], next_y[point] - y[point]
        square = ahead * ahead + aside * aside
        scale = 1.0 / np.sqrt(square) if square > 0.0 else 0.0
        to_x[point], to_y[point] = scale * ahead, scale * aside


@device_function(divides_by_zero=True)
def _write(
    pieces: _Pieces, near: Int64, order: Int64, lines: _Lines, place: tuple[int, int], out: PolylineArrays
) -> None:
    """Write some polylines of a sample; the last point of each has the direction of the one before.

    Args:
        pieces, near, order: The pieces.
        lines: Their points.
        place: Sample, and number of the first polyline.
        out: Filled.
    """
    points = len(lines.x) // _TOGETHER
    sample, line = place
    features = out.points[sample, NUM_FEATURES * points * line : NUM_FEATURES * points * (line + len(order))]
    valid = out.valid[sample, points * line : points * (line + len(order))]
    _interleave(lines.own_x, lines.own_y, lines.direction_x, lines.direction_y, features)
    valid[:] = True
    for number in range(len(order)):
        piece = near[order[number]]
        first, length = number * points, pieces.lengths[piece]
        out.kind[sample, line + number] = pieces.kinds[piece]
        last = first + length - 1
        for axis in range(DIRECTION_X, NUM_FEATURES):
            before = features[NUM_FEATURES * (last - 1) + axis] if length > 1 else np.float32(0.0)
            features[NUM_FEATURES * last + axis] = before
        valid[last + 1 : first + points] = False
        features[NUM_FEATURES * (last + 1) : NUM_FEATURES * (first + points)] = 0.0


@device_function(divides_by_zero=True, in_lanes=True)
def _interleave(x: Float32, y: Float32, direction_x: Float32, direction_y: Float32, features: Float32) -> None:
    """Write the features of points."""
    for point in range(len(features) // NUM_FEATURES):
        features[NUM_FEATURES * point + X] = x[point]
        features[NUM_FEATURES * point + Y] = y[point]
        features[NUM_FEATURES * point + DIRECTION_X] = direction_x[point]
        features[NUM_FEATURES * point + DIRECTION_Y] = direction_y[point]
