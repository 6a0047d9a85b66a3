"""Compiled loops from the joined lists of several scenarios to a block of memory each, of which samples are made.

S scenarios, R rows (objects) of all scenarios, M map features of all scenarios; N points of a piece of the map.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Int32, Int64, UInt8
from scenarionet_data.compiled.decorators import device_function, kernel

WORD = 4
"""Bytes of most values in a block; places in it are counted in words from its start."""
ALIGNMENT = 64
"""Blocks begin at multiples of so many bytes."""

NUM_TRACKS, NUM_STATES, NUM_TIMES, NUM_PIECES, STATES, SIZES, TRACKS, PIECES, POINTS, FLAGS = range(10)
"""Words at the start of a block: numbers, and the places of arrays.

STATES: for each object x of all states, y, heading, velocity along x, and y, float32. SIZES: lengths, widths, heights
of objects, float32. TRACKS: TRACK_FIELDS int32 for each object. PIECES: number of points, then MapFeatureType of each,
int32; then x of each one's first point, then y, float32. POINTS: for each piece x of its N points, then y, float32; the
last one is repeated. FLAGS: VALID and INTERPOLATED of each state, a byte each."""
NUM_STATE_FIELDS = 5
NUM_PIECE_FIELDS = 4
TIMES = 16
"""Place of the recorded times [s], float64."""

TRACK_FIELDS = 9
KIND, START, SPAN, FIRST, EXTENTS = range(5)
"""Of an object: ObjectType, first timestep, number of states, number of its first state; and for length, width and
height the number of the first one, doubled, and 1 more if they change."""
NUM_EXTENTS = 3

VALID, INTERPOLATED = 1, 2


class TrackLists(NamedTuple):
    """Objects of all scenarios: lists over their spans, as in the table ``tracks``."""

    bounds: Int64  # (S + 1,) first row of each scenario
    kind: UInt8  # (R,) ObjectType
    start: Int32  # (R,)
    spans: Int32  # (R,) length of each list
    offsets: Int32  # (R + 1,)
    x: Float32
    y: Float32
    heading: Float32
    vx: Float32
    vy: Float32
    length_offsets: Int32  # (R + 1,); lists of one element hold at all timesteps
    length: Float32
    width_offsets: Int32
    width: Float32
    height_offsets: Int32
    height: Float32
    valid_offsets: Int32  # (R + 1,); empty lists where all timesteps are valid
    valid: Bool
    flag_offsets: Int32  # (R + 1,); empty lists where no timestep is interpolated
    is_interpolated: Bool


class MapLists(NamedTuple):
    """Map features of all scenarios: lists of points."""

    bounds: Int64  # (S + 1,) first feature of each scenario
    kind: UInt8  # (M,) MapFeatureType
    offsets: Int32  # (M + 1,) of polylines
    x: Float32
    y: Float32
    outline_offsets: Int32  # (M + 1,) of polygons
    outline_x: Float32
    outline_y: Float32


class Times(NamedTuple):
    """Recorded times of all scenarios."""

    bounds: Int64  # (S + 1,) first one of each scenario
    values: Float64  # [s]


class Cutting(NamedTuple):
    """How map features become pieces: polylines of equally spaced points."""

    spacing: float  # between points along a feature [m]; the last one of a feature is nearer
    points: int  # N, largest number of points of a piece
    steps: Float64  # distance of each point of the polylines, then of the outlines, to the one before [m]
    counts: Int32  # (M,) number of points of each feature


class SceneMemory(NamedTuple):
    """Memory of all blocks, as values of each kind."""

    ints: Int32
    floats: Float32
    doubles: Float64
    bytes: UInt8


@kernel(nogil=True, allocates=False, divides_by_zero=True)
def measure(tracks: TrackLists, features: MapLists, times: Times, cutting: Cutting, numbers: Int64) -> None:
    """Measure the segments of features, count the points to be put on them, and the bytes of each block.

    Args:
        tracks, features, times: The scenarios.
        cutting: ``steps`` and ``counts`` are filled.
        numbers: (S, 2), filled with the bytes of each scenario's block, and its number of pieces.
    """
    for scene in range(len(numbers)):
        pieces = 0
        for feature in range(features.bounds[scene], features.bounds[scene + 1]):
            first, end, is_closed = _span(features, feature)
            cutting.counts[feature] = 0
            if first == end:
                continue
            x, y, base = features.x, features.y, 0
            if is_closed:
                x, y, base = features.outline_x, features.outline_y, len(features.x)
            length = _measure(x[first:end], y[first:end], is_closed, cutting.steps[base + first : base + end])
            cutting.counts[feature] = 1 + int(np.ceil(length / cutting.spacing - 1e-6)) if length > 0.0 else 1
            pieces += _num_pieces(cutting.counts[feature], cutting.points)
        first, end = tracks.bounds[scene], tracks.bounds[scene + 1]
        states = np.int64(tracks.offsets[end] - tracks.offsets[first])
        sizes = tracks.length_offsets[end] - tracks.length_offsets[first]
        sizes += tracks.width_offsets[end] - tracks.width_offsets[first]
        sizes += tracks.height_offsets[end] - tracks.height_offsets[first]
        words = TIMES + 2 * (times.bounds[scene + 1] - times.bounds[scene]) + NUM_STATE_FIELDS * states
        words += sizes + TRACK_FIELDS * (end - first) + pieces * (NUM_PIECE_FIELDS + 2 * cutting.points)
        numbers[scene, 0] = -(-(WORD * words + states) // ALIGNMENT) * ALIGNMENT
        numbers[scene, 1] = pieces


@device_function(divides_by_zero=True)
def _span(features: MapLists, feature: int) -> tuple[int, int, int]:
    """First and last point of a feature's polyline, and 0; of its outline, which is closed, and 1, if it has none."""
    first, end = features.offsets[feature], features.offsets[feature + 1]
    if end > first:
        return first, end, 0
    return features.outline_offsets[feature], features.outline_offsets[feature + 1], 1


@device_function(divides_by_zero=True)
def _measure(x: Float32, y: Float32, is_closed: int, steps: Float64) -> Any:
    """Distance of each point of a line to the one before, of the first to the last; returns the length of the line."""
    # Of slices, because the compiler sees that their indices are not negative: it measures several points at once.
    for point in range(1, len(steps)):
        ahead, aside = np.float64(x[point]) - x[point - 1], np.float64(y[point]) - y[point - 1]
        steps[point] = np.sqrt(ahead * ahead + aside * aside)
    ahead, aside = np.float64(x[0]) - x[-1], np.float64(y[0]) - y[-1]
    steps[0] = np.sqrt(ahead * ahead + aside * aside)
    length = 0.0
    for point in range(1, len(steps)):
        length += steps[point]
    return length + steps[0] * is_closed


@device_function
def _num_pieces(num_points: int, points: int) -> int:
    """Adjacent pieces share a point."""
    return num_points if num_points < 2 else (num_points - 2) // (points - 1) + 1


@kernel(nogil=True, allocates=False, divides_by_zero=True)
def store(
    tracks: TrackLists,
    features: MapLists,
    times: Times,
    cutting: Cutting,
    numbers: Int64,
    blocks: Int64,
    memory: SceneMemory,
) -> None:
    """Fill the blocks of scenarios.

    Args:
        tracks, features, times: The scenarios.
        cutting, numbers: See :func:`measure`.
        blocks: (S,) place of each scenario's block in ``memory`` [words]; -1 for those that are left out.
        memory: Filled.
    """
    ints, doubles = memory.ints, memory.doubles
    for scene in range(len(blocks)):
        block = blocks[scene]
        if block < 0:
            continue
        first, last = times.bounds[scene], times.bounds[scene + 1]
        for number in range(last - first):
            doubles[(block + TIMES) // 2 + number] = times.values[first + number]
        pieces = numbers[scene, 1]
        ints[block + NUM_TIMES], ints[block + NUM_PIECES] = last - first, pieces
        ints[block + STATES] = TIMES + 2 * (last - first)
        end = _store_tracks(tracks, scene, block, memory)
        ints[block + PIECES], ints[block + POINTS] = end, end + NUM_PIECE_FIELDS * pieces
        ints[block + FLAGS] = end + pieces * (NUM_PIECE_FIELDS + 2 * cutting.points)
        _store_flags(tracks, scene, block, memory)
        _cut(features, cutting, scene, block, memory)


@device_function(divides_by_zero=True)
def _store_tracks(tracks: TrackLists, scene: int, block: int, memory: SceneMemory) -> Any:
    """Store states, sizes and objects; returns the place behind them."""
    ints, floats = memory.ints, memory.floats
    rows, end = tracks.bounds[scene], tracks.bounds[scene + 1]
    first = tracks.offsets[rows]
    count = np.int64(tracks.offsets[end] - first)
    at = np.int64(ints[block + STATES])
    for row in range(rows, end):
        begin, span = tracks.offsets[row], np.int64(tracks.spans[row])
        states = floats[block + at + NUM_STATE_FIELDS * (begin - first) :]
        for number in range(span):
            states[number] = tracks.x[begin + number]
            states[span + number] = tracks.y[begin + number]
            states[2 * span + number] = tracks.heading[begin + number]
            states[3 * span + number] = tracks.vx[begin + number]
            states[4 * span + number] = tracks.vy[begin + number]
    at += NUM_STATE_FIELDS * count
    sizes = floats[block + at :]
    widths = tracks.length_offsets[end] - tracks.length_offsets[rows]
    heights = widths + tracks.width_offsets[end] - tracks.width_offsets[rows]
    num_sizes = heights + tracks.height_offsets[end] - tracks.height_offsets[rows]
    ints[block + NUM_TRACKS], ints[block + NUM_STATES] = end - rows, count
    ints[block + SIZES], ints[block + TRACKS] = at, at + num_sizes
    for row in range(rows, end):
        fields = ints[block + at + num_sizes + TRACK_FIELDS * (row - rows) :]
        fields[KIND], fields[START], fields[SPAN] = tracks.kind[row], tracks.start[row], tracks.spans[row]
        fields[FIRST] = tracks.offsets[row] - first
        fields[EXTENTS] = _store_extents(tracks.length_offsets, tracks.length, rows, row, 0, sizes)
        fields[EXTENTS + 1] = _store_extents(tracks.width_offsets, tracks.width, rows, row, widths, sizes)
        fields[EXTENTS + 2] = _store_extents(tracks.height_offsets, tracks.height, rows, row, heights, sizes)
    return at + num_sizes + TRACK_FIELDS * (end - rows)


@device_function(divides_by_zero=True)
def _store_extents(offsets: Int32, extents: Float32, rows: int, row: int, base: int, sizes: Float32) -> Any:
    """Store a list of extents; returns its field of the object."""
    place, count = base + offsets[row] - offsets[rows], offsets[row + 1] - offsets[row]
    for number in range(count):
        sizes[place + number] = extents[offsets[row] + number]
    return 2 * place + (1 if count > 1 else 0)


@device_function(divides_by_zero=True)
def _store_flags(tracks: TrackLists, scene: int, block: int, memory: SceneMemory) -> None:
    """Store whether states are valid, and interpolated; lists are empty where all are valid, and none interpolated."""
    at = WORD * (block + memory.ints[block + FLAGS])
    for row in range(tracks.bounds[scene], tracks.bounds[scene + 1]):
        valid, flags = tracks.valid_offsets[row], tracks.flag_offsets[row]
        has_valid = tracks.valid_offsets[row + 1] > valid
        has_flags = tracks.flag_offsets[row + 1] > flags
        for place in range(tracks.spans[row]):
            found = VALID if not has_valid or tracks.valid[valid + place] else 0
            if has_flags and tracks.is_interpolated[flags + place]:
                found |= INTERPOLATED
            memory.bytes[at + place] = found
        at += tracks.spans[row]


@device_function(divides_by_zero=True)
def _cut(features: MapLists, cutting: Cutting, scene: int, block: int, memory: SceneMemory) -> None:
    """Put points at equal distances along features, and cut them into pieces; the last point of a piece is repeated."""
    points, steps, spacing = cutting.points, cutting.steps, cutting.spacing
    pieces = np.int64(memory.ints[block + NUM_PIECES])
    described = memory.ints[block + memory.ints[block + PIECES] :]
    firsts = memory.floats[block + memory.ints[block + PIECES] + 2 * pieces :]
    at = block + memory.ints[block + POINTS]
    found = memory.floats[at : at + 2 * pieces * points]
    piece = 0
    for feature in range(features.bounds[scene], features.bounds[scene + 1]):
        count = cutting.counts[feature]
        if count == 0:
            continue
        first, end, is_closed = _span(features, feature)
        x, y, base = features.x, features.y, 0
        if is_closed:
            x, y, base = features.outline_x, features.outline_y, len(features.x)
        number, walked, final = 0, 0.0, end - 1 + is_closed
        point = min(first + 1, final)
        step = steps[base + (point if point < end else first)]
        here_x, here_y = np.float64(x[first]), np.float64(y[first])
        for _ in range(_num_pieces(count, points)):  # each begins with the last point of the one before
            place = 2 * piece * points
            found[place], found[place + points] = here_x, here_y
            firsts[piece], firsts[pieces + piece] = here_x, here_y
            begin, last = number, min(number + points, count) - 1
            while number < last:
                number += 1
                arc = number * spacing - walked
                while arc > step and point < final:
                    arc -= step
                    walked += step
                    point += 1
                    step = steps[base + (point if point < end else first)]
                before, after = point - 1, point if point < end else first
                from_x, from_y = np.float64(x[before]), np.float64(y[before])
                scale = 1.0 / step if step > 0.0 else 0.0
                arc = min(arc, step)
                here_x = from_x + arc * ((x[after] - from_x) * scale)
                here_y = from_y + arc * ((y[after] - from_y) * scale)
                found[place + number - begin], found[place + points + number - begin] = here_x, here_y
            for rest in range(number - begin + 1, points):
                found[place + rest], found[place + points + rest] = here_x, here_y
            described[piece], described[pieces + piece] = number - begin + 1, features.kind[feature]
            piece += 1
