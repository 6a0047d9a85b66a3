"""NamedTuples of arrays, for kernels that read many of them.

Numba needs about 0.3 µs per field to unpack a NamedTuple, so kernels that need few arrays take them individually.
"""

from __future__ import annotations

from typing import NamedTuple

from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Int32, Int64, UInt8, UInt32


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


(
    NUM_OBJECTS, NUM_STEPS, EGO, FIRST_STEP, DRIVERS, OBJECTS, LOG, LIGHTS, CELLS,
) = range(9)  # fmt: skip
"""Columns of ``Recorded.place``: numbers of objects and timesteps; row of the ego; first timestep with a valid ego;
policies that drive at least one object, as bits; first rows in the arrays of objects, log, light states and cells."""

NUM_PLACES = 9


class Recorded(NamedTuple):
    """Recorded worlds of a ``WorldPool`` in flat arrays, and where the worlds of W slots are in them.

    Object n of slot w has the row ``place[w, OBJECTS] + n``; its state at timestep t is the row
    ``place[w, LOG] + t * place[w, NUM_OBJECTS] + n`` of the log; light l at timestep t has the entry
    ``place[w, LIGHTS] + l * place[w, NUM_STEPS] + t``. Every world has one more row of objects, for the end of its
    last path and its last stop.

    Attributes:
        place: (W, NUM_PLACES), see above.
        log: (R, 8), see ``kernels.log``.
        driver: (O,) policy of each object.
        object_type, size, top_speed: (O,) codes of ``ObjectType``; (O, 3) [m]; (O,) highest recorded speed [m/s].
        path, path_offsets: (P, 5), see ``Paths``; (O,) first row in ``path``.
        stop_arc, stop_light, stop_offsets: (K,), (K,), see ``Stops``; (O,) first row in ``stop_arc``.
        light_state: (B,) codes of ``LightState``.
    """

    place: Int64
    log: Float32
    driver: UInt8
    object_type: UInt8
    size: Float32
    top_speed: Float32
    path: Float32
    path_offsets: Int32
    stop_arc: Float32
    stop_light: Int32
    stop_offsets: Int32
    light_state: UInt8


class Lines(NamedTuple):
    """Line segments of the maps of W slots, cell by cell of a grid each, so that a ray reads them in sequence.

    Cell c of slot w has the segments ``cell_start[place[w, CELLS] + c]`` to that of the next cell.

    Attributes:
        place: (W, NUM_PLACES), see ``Recorded``.
        frame: (W, 5) x, y of the lower left corner and side of a cell [m]; numbers of columns and rows.
        cell_start: (C,) first segment of each cell, with one more entry for every map.
        cell_types: (C,) types in the cell: bit k is set for types of the code k modulo 32.
        segments: (K, 4) x0, y0, x1, y1 [m]; a segment is in every cell that it touches.
        segment_type: (K,) codes of ``MapFeatureType``.
    """

    place: Int64
    frame: Float64
    cell_start: Int32
    cell_types: UInt32
    segments: Float32
    segment_type: UInt8


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
