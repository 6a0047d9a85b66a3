"""NamedTuples of arrays, for kernels that read many of them.

Numba needs about 0.3 µs per field to unpack a NamedTuple, so kernels that need few arrays take them individually.
"""

from __future__ import annotations

from typing import NamedTuple

from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Int32, UInt8


class StateArrays(NamedTuple):
    """Arrays of a ``State``: everything that moves in W worlds of N objects, at one moment.

    Attributes:
        motion: (W, N, 7) x, y, z [m], heading [rad], velocity x, y [m/s], yaw rate [rad/s].
        route: (W, N, 2) arc length along and lateral offset from the object's own path [m].
        present: (W, N).
        size: (W, N, 3) length, width, height [m].
        object_type: (W, N) codes of ``ObjectType``.
        timestep: (W,).
    """

    motion: Float64
    route: Float64
    present: Bool
    size: Float64
    object_type: UInt8
    timestep: Int32


class Recorded(NamedTuple):
    """Arrays of a ``WorldBatch``: logs, paths and traffic lights of W worlds, padded.

    Attributes:
        log: (W, T, N, 8), see ``kernels.log``.
        num_steps: (W,) timesteps of each log.
        top_speed: (W, N) highest recorded speed [m/s].
        path, path_offsets: (W, P, 5), (W, N + 1), see ``Paths``.
        stop_arc, stop_light, stop_offsets: (W, K), (W, K), (W, N + 1), see ``Stops``.
        light_state: (W, L, T) codes of ``LightState``.
    """

    log: Float32
    num_steps: Int32
    top_speed: Float32
    path: Float32
    path_offsets: Int32
    stop_arc: Float32
    stop_light: Int32
    stop_offsets: Int32
    light_state: UInt8


class Lines(NamedTuple):
    """Line segments of W maps under a grid each.

    Attributes:
        segments: (W, S, 4) x0, y0, x1, y1 [m].
        segment_type: (W, S) codes of ``MapFeatureType``.
        frame, cell_start, cell_items: (W, 5), (W, C + 1), (W, K), see ``roads.grid.Grid``.
    """

    segments: Float32
    segment_type: UInt8
    frame: Float64
    cell_start: Int32
    cell_items: Int32


class Lanes(NamedTuple):
    """M lanes of a map and their successors.

    Attributes:
        points, offsets: (P, 2) [m], (M + 1,) centrelines.
        successors, successor_offsets: (K,) rows, (M + 1,).
        turn: (M,) change of direction from start to end [rad].
    """

    points: Float32
    offsets: Int32
    successors: Int32
    successor_offsets: Int32
    turn: Float64
