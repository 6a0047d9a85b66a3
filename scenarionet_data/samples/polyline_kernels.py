"""Compiled loops from map features to polylines of equally spaced points in the frames of samples."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from scenarionet_data.arrays.compiled import device_function, kernel
from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Int32, Int64, UInt8

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


@kernel(nogil=True)
def count_points(features: MapLists, spacing: float, scene: Int32, pose: Float64, radius: float, counts: Int32) -> None:
    """Count the points that :func:`cut` puts on each feature; 0 if it is far from every sample of its scenario.

    Args:
        features: M features.
        spacing: Distance between points [m]; the last one of a feature is nearer.
        scene: (B,) scenario of each sample.
        pose: (B, 4) see ``AgentArrays``.
        radius: Largest distance from a sample's centre [m].
        counts: (M,), filled.
    """
    for number in range(len(features.bounds) - 1):
        for feature in range(features.bounds[number], features.bounds[number + 1]):
            x, y, is_closed = _line(features, feature)
            counts[feature] = 0
            if len(x) == 0 or not _is_near(x, y, number, scene, pose, radius):
                continue
            length = 0.0
            for point in range(1, len(x) + is_closed):
                length += _distance(x, y, point)
            counts[feature] = 1 + int(np.ceil(length / spacing - 1e-6)) if length > 0.0 else 1


@device_function(allocates=True)
def _is_near(x: Float32, y: Float32, number: int, scene: Int32, pose: Float64, radius: float) -> bool:
    """Whether the bounding box of a line is near the centre of any sample of its scenario."""
    min_x, max_x, min_y, max_y = x[0], x[0], y[0], y[0]
    for point in range(1, len(x)):
        min_x, max_x = min(min_x, x[point]), max(max_x, x[point])
        min_y, max_y = min(min_y, y[point]), max(max_y, y[point])
    is_near = False
    for sample in range(len(scene)):
        if scene[sample] == number:
            aside = max(min_x - pose[sample, 0], pose[sample, 0] - max_x, 0.0)
            ahead = max(min_y - pose[sample, 1], pose[sample, 1] - max_y, 0.0)
            is_near |= aside * aside + ahead * ahead <= radius * radius
    return is_near


@kernel(nogil=True)
def count_pieces(features: MapLists, counts: Int32, points: int, bounds: Int64) -> None:
    """Count the pieces of at most ``points`` points of each scenario, as offsets (S + 1,)."""
    bounds[0] = 0
    for scene in range(len(features.bounds) - 1):
        bounds[scene + 1] = bounds[scene]
        for feature in range(features.bounds[scene], features.bounds[scene + 1]):
            bounds[scene + 1] += _num_pieces(counts[feature], points)


@device_function(allocates=True)
def _line(features: MapLists, feature: int) -> tuple[Float32, Float32, int]:
    """Points of a feature's polyline; of its outline, which is closed, if it has none."""
    first, end = features.offsets[feature], features.offsets[feature + 1]
    if end > first:
        return features.x[first:end], features.y[first:end], 0
    first, end = features.outline_offsets[feature], features.outline_offsets[feature + 1]
    return features.outline_x[first:end], features.outline_y[first:end], 1


@device_function
def _distance(x: Float32, y: Float32, point: int) -> Any:
    """Distance of a point to the one before; the point after the last is the first."""
    other = point if point < len(x) else 0
    ahead, aside = np.float64(x[other]) - x[point - 1], np.float64(y[other]) - y[point - 1]
    return np.sqrt(ahead * ahead + aside * aside)


@device_function
def _num_pieces(num_points: int, points: int) -> int:
    """Adjacent pieces share a point."""
    return num_points if num_points < 2 else (num_points - 2) // (points - 1) + 1


@kernel(nogil=True)
def cut(features: MapLists, counts: Int32, spacing: float, pieces: MapPieces) -> None:
    """Put points at equal distances along the features, and cut them into pieces.

    Args:
        features: M features.
        counts: (M,) number of points of each, see :func:`count_points`.
        spacing: Distance between points [m].
        pieces: With ``bounds``; the other arrays are filled.
    """
    points = pieces.x.shape[1]
    piece = 0
    for feature in range(features.bounds[-1]):
        count = counts[feature]
        if count == 0:
            continue
        x, y, is_closed = _line(features, feature)
        point, walked, at, end = 1, 0.0, 0, len(x) + is_closed - 1
        from_x, from_y, along_x, along_y, step = _segment(x, y, point)
        for number in range(count):
            arc = number * spacing - walked
            while arc > step and point < end:
                arc -= step
                walked += step
                point += 1
                from_x, from_y, along_x, along_y, step = _segment(x, y, point)
            arc = min(arc, step)
            here_x, here_y = from_x + arc * along_x, from_y + arc * along_y
            pieces.x[piece, at], pieces.y[piece, at] = here_x, here_y
            at += 1
            if at == points and number + 1 < count:  # the next piece begins with the last point of this one
                pieces.lengths[piece], pieces.kind[piece] = points, features.kind[feature]
                piece += 1
                pieces.x[piece, 0], pieces.y[piece, 0] = here_x, here_y
                at = 1
        pieces.lengths[piece], pieces.kind[piece] = at, features.kind[feature]
        piece += 1


@device_function
def _segment(x: Float32, y: Float32, point: int) -> Any:
    """Beginning, unit direction and length of the line to a point from the one before; of no length for one point."""
    if len(x) == 1:
        return np.float64(x[0]), np.float64(y[0]), 0.0, 0.0, 0.0
    other = point if point < len(x) else 0
    from_x, from_y = np.float64(x[point - 1]), np.float64(y[point - 1])
    ahead, aside = x[other] - from_x, y[other] - from_y
    step = np.sqrt(ahead * ahead + aside * aside)
    scale = 1.0 / step if step > 0.0 else 0.0
    return from_x, from_y, ahead * scale, aside * scale, step


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
        for place in range(min(count, out.kind.shape[1])):
            piece = found[order[place]]
            out.kind[sample, place] = pieces.kind[piece]
            length = pieces.lengths[piece]
            out.valid[sample, place, :length] = True
            _fill_points(pieces.x[piece, :length], pieces.y[piece, :length], pose[sample], out.points[sample, place])


@device_function
def _fill_points(x: Float32, y: Float32, pose: Float64, points: Float32) -> None:
    """Fill positions and directions; the last point has the direction of the one before."""
    cos, sin, mirror = np.cos(pose[2]), np.sin(pose[2]), pose[3]
    for point in range(len(x)):
        ahead, aside = x[point] - pose[0], y[point] - pose[1]
        points[point, X], points[point, Y] = cos * ahead + sin * aside, mirror * (cos * aside - sin * ahead)
    for point in range(len(x) - 1):
        ahead, aside = points[point + 1, X] - points[point, X], points[point + 1, Y] - points[point, Y]
        length = np.sqrt(ahead * ahead + aside * aside)
        if length > 0.0:
            points[point, DIRECTION_X], points[point, DIRECTION_Y] = ahead / length, aside / length
    if len(x) > 1:
        points[len(x) - 1, DIRECTION_X] = points[len(x) - 2, DIRECTION_X]
        points[len(x) - 1, DIRECTION_Y] = points[len(x) - 2, DIRECTION_Y]
