"""Compiled loops from map features to polylines of equally spaced points in the frames of samples."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Int32, Int64, UInt8
from scenarionet_data.compiled.decorators import device_function, kernel

X, Y, DIRECTION_X, DIRECTION_Y = range(4)
"""Features of a point, in the sample's frame."""


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


class Centres(NamedTuple):
    """Centres of the samples of each scenario."""

    bounds: Int64  # (S + 1,) first centre of each scenario
    x: Float64  # (B,) [m]; NaN for samples without a centre
    y: Float64  # (B,) [m]


class MapPieces(NamedTuple):
    """Polylines of at most N points, in the frames of their scenarios."""

    bounds: Int64  # (S + 1,) first piece of each scenario
    x: Float32  # (P, N) [m]
    y: Float32  # (P, N) [m]
    lengths: Int32  # (P,) number of points
    kind: UInt8  # (P,) MapFeatureType


class PolylineArrays(NamedTuple):
    """Arrays that are filled: zeros."""

    points: Float32  # (B, L, N, 4)
    valid: Bool  # (B, L, N)
    kind: Int32  # (B, L)


@kernel(nogil=True, allocates=False, divides_by_zero=True)
def measure(
    features: MapLists, spacing: float, points: int, centres: Centres, radius: float, steps: Float64, counts: Int32
) -> int:
    """Measure the segments of features, and count the points that :func:`cut` puts on them.

    Args:
        features: M features.
        spacing: Distance between points [m]; the last one of a feature is nearer.
        points: Largest number of points of a piece.
        centres: Centres of the samples.
        radius: Largest distance from a centre [m].
        steps: Filled with the distance of each point of the polylines, then of the outlines, to the one before [m].
        counts: (M,), filled; 0 for a feature that is far from every sample of its scenario.

    Returns:
        Number of pieces of all features.
    """
    pieces = 0
    for scene in range(len(features.bounds) - 1):
        for feature in range(features.bounds[scene], features.bounds[scene + 1]):
            first, end, is_closed = _span(features, feature)
            x, y = features.x, features.y
            if is_closed:
                x, y = features.outline_x, features.outline_y
            counts[feature] = 0
            if first == end or not _is_near(x, y, first, end, scene, centres, radius):
                continue
            base = len(features.x) * is_closed
            length = _measure(x[first:end], y[first:end], is_closed, steps[base + first : base + end])
            counts[feature] = 1 + int(np.ceil(length / spacing - 1e-6)) if length > 0.0 else 1
            pieces += _num_pieces(counts[feature], points)
    return pieces


@device_function(divides_by_zero=True)
def _span(features: MapLists, feature: int) -> tuple[int, int, int]:
    """First and last point of a feature's polyline, and 0; of its outline, which is closed, and 1, if it has none."""
    first, end = features.offsets[feature], features.offsets[feature + 1]
    if end > first:
        return first, end, 0
    return features.outline_offsets[feature], features.outline_offsets[feature + 1], 1


@device_function(divides_by_zero=True)
def _is_near(x: Float32, y: Float32, first: int, end: int, scene: int, centres: Centres, radius: float) -> bool:
    """Whether the bounding box of a line is near the centre of any sample of its scenario."""
    if _is_within(x[first], y[first], scene, centres, radius):
        return True
    min_x, max_x, min_y, max_y = x[first], x[first], y[first], y[first]
    for point in range(first + 1, end):
        min_x, max_x = min(min_x, x[point]), max(max_x, x[point])
        min_y, max_y = min(min_y, y[point]), max(max_y, y[point])
    is_near = False
    for sample in range(centres.bounds[scene], centres.bounds[scene + 1]):
        aside = max(min_x - centres.x[sample], centres.x[sample] - max_x, 0.0)
        ahead = max(min_y - centres.y[sample], centres.y[sample] - max_y, 0.0)
        is_near |= aside * aside + ahead * ahead <= radius * radius
    return is_near


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
def cut(
    features: MapLists,
    steps: Float64,
    counts: Int32,
    spacing: float,
    centres: Centres,
    radius: float,
    pieces: MapPieces,
) -> None:
    """Put points at equal distances along the features, cut them into pieces, and keep those near a sample.

    Args:
        features: M features.
        steps: Lengths of their segments, see :func:`measure`.
        counts: (M,) number of points of each.
        spacing: Distance between points [m].
        centres: Centres of the samples.
        radius: Largest distance of a piece's nearest point from a centre [m].
        pieces: Filled; with memory for one piece more than are kept.
    """
    points = pieces.x.shape[1]
    beyond = radius + spacing * (points - 1)
    piece = 0
    pieces.bounds[0] = 0
    for scene in range(len(features.bounds) - 1):
        for feature in range(features.bounds[scene], features.bounds[scene + 1]):
            count = counts[feature]
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
                pieces.x[piece, 0], pieces.y[piece, 0] = here_x, here_y
                is_kept = _is_within(pieces.x[piece, 0], pieces.y[piece, 0], scene, centres, beyond)
                begin, last = number, min(number + points, count) - 1
                if not is_kept:  # only its last two points matter to the next piece
                    number = max(number, last - 2)
                while number < last:
                    number += 1
                    arc = number * spacing - walked
                    while arc > step and point < final:
                        arc -= step
                        walked += step
                        point += 1
                        step = steps[base + (point if point < end else first)]
                    if is_kept or number == last:
                        before, after = point - 1, point if point < end else first
                        from_x, from_y = np.float64(x[before]), np.float64(y[before])
                        scale = 1.0 / step if step > 0.0 else 0.0
                        arc = min(arc, step)
                        here_x = from_x + arc * ((x[after] - from_x) * scale)
                        here_y = from_y + arc * ((y[after] - from_y) * scale)
                        pieces.x[piece, number - begin], pieces.y[piece, number - begin] = here_x, here_y
                if is_kept:
                    pieces.lengths[piece], pieces.kind[piece] = number - begin + 1, features.kind[feature]
                    piece += 1
        pieces.bounds[scene + 1] = piece


@device_function(divides_by_zero=True)
def _is_within(x: Any, y: Any, scene: int, centres: Centres, reach: float) -> bool:
    """Whether a point is near the centre of any sample of its scenario."""
    is_within = False
    for sample in range(centres.bounds[scene], centres.bounds[scene + 1]):
        aside, ahead = x - np.float32(centres.x[sample]), y - np.float32(centres.y[sample])
        is_within |= aside * aside + ahead * ahead <= reach * reach
    return is_within


@kernel(nogil=True)
def fill_polylines(
    pieces: MapPieces, spacing: float, scene: Int32, pose: Float64, radius: float, out: PolylineArrays
) -> None:
    """Fill in the pieces nearest to the centre of each sample, in its frame.

    Args:
        pieces: The pieces of all scenarios.
        spacing: Largest distance between their points [m].
        scene: (B,) scenario of each sample.
        pose: (B, 4) see ``AgentArrays``.
        radius: Largest distance of a piece's nearest point [m].
        out: Filled.
    """
    longest = 0
    for number in range(len(pieces.bounds) - 1):
        longest = max(longest, pieces.bounds[number + 1] - pieces.bounds[number])
    found, distances = np.empty(longest, np.int64), np.empty(longest, np.float32)
    beyond = radius + spacing * (pieces.x.shape[1] - 1)
    for sample in range(len(scene)):
        if np.isnan(pose[sample, 0]):
            continue
        x, y = np.float32(pose[sample, 0]), np.float32(pose[sample, 1])
        count = 0
        for piece in range(pieces.bounds[scene[sample]], pieces.bounds[scene[sample] + 1]):
            aside, ahead = pieces.x[piece, 0] - x, pieces.y[piece, 0] - y
            nearest = aside * aside + ahead * ahead
            if nearest > beyond * beyond:  # and its other points are outside of the radius
                continue
            for point in range(1, pieces.lengths[piece]):
                aside, ahead = pieces.x[piece, point] - x, pieces.y[piece, point] - y
                distance = aside * aside + ahead * ahead
                if distance < nearest:
                    nearest = distance
            if nearest <= radius * radius:
                found[count], distances[count] = piece, nearest
                count += 1
        order = np.argsort(distances[:count], kind="mergesort")
        cos, sin = np.cos(pose[sample, 2]), np.sin(pose[sample, 2])
        for place in range(min(count, out.kind.shape[1])):
            _fill_piece(pieces, found[order[place]], pose, cos, sin, sample, place, out)


@device_function
def _fill_piece(
    pieces: MapPieces, piece: int, pose: Float64, cos: float, sin: float, sample: int, place: int, out: PolylineArrays
) -> None:
    """Fill positions and directions; the last point has the direction of the one before."""
    x, y, mirror, length = pose[sample, 0], pose[sample, 1], pose[sample, 3], pieces.lengths[piece]
    points, valid = out.points[sample, place], out.valid[sample, place]
    out.kind[sample, place] = pieces.kind[piece]
    for point in range(length):
        ahead, aside = pieces.x[piece, point] - x, pieces.y[piece, point] - y
        points[point, X], points[point, Y] = cos * ahead + sin * aside, mirror * (cos * aside - sin * ahead)
        valid[point] = True
    for point in range(length - 1):
        ahead, aside = points[point + 1, X] - points[point, X], points[point + 1, Y] - points[point, Y]
        step = np.sqrt(ahead * ahead + aside * aside)
        if step > 0.0:
            points[point, DIRECTION_X], points[point, DIRECTION_Y] = ahead / step, aside / step
    if length > 1:
        points[length - 1, DIRECTION_X] = points[length - 2, DIRECTION_X]
        points[length - 1, DIRECTION_Y] = points[length - 2, DIRECTION_Y]
