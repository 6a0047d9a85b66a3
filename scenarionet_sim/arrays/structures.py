"""NamedTuples of arrays, for kernels that read many of them.

Numba needs about 0.3 µs per field to unpack a NamedTuple, so kernels that need few arrays take them individually.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Int32, Int64, UInt8


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


NUM_OBJECTS, NUM_STEPS, EGO, FIRST_STEP, DRIVERS, OBJECTS, LOG, LIGHTS, CELLS, BLOCKS, PIECE_CELLS = range(11)
"""Columns of ``Recorded.place``: numbers of objects and timesteps; row of the ego; first timestep with a valid ego;
policies that drive at least one object, as bits; first rows in the arrays of objects, log, light states, cells, and
blocks of cells, and cells of the pieces of the road."""

NUM_PLACES = 11


USERS, USED, SERIAL = range(3)
"""Columns of ``StoredWorlds.usage``: number of slots that play the world, ``FREE`` for a number without one; when a
slot last stopped playing it; how many worlds were stored before it and with it, as numbers are used again."""

FREE = -1


class StoredWorlds(NamedTuple):
    """The worlds of a ``WorldPool`` by number, of which some are free.

    Attributes:
        place: (P, NUM_PLACES) where their rows are, see ``Recorded``.
        frame: (P, 10) see ``Lines``.
        usage: (P, 3) see ``USERS``.
    """

    place: Int64
    frame: Float64
    usage: Int64

    @classmethod
    def of_none(cls) -> StoredWorlds:
        """Return the arrays of no worlds."""
        return cls(np.zeros((0, NUM_PLACES), np.int64), np.zeros((0, 10)), np.zeros((0, 3), np.int64))


class Slots(NamedTuple):
    """The worlds that W slots play.

    Attributes:
        number: (W,) number of each slot's world among the ``StoredWorlds``, -1 for none.
        place, frame: (W, NUM_PLACES), (W, 10) see ``Recorded`` and ``Lines``.
    """

    number: Int64
    place: Int64
    frame: Float64


class Series(NamedTuple):
    """What slots play of n scenarios.

    Attributes:
        playing: (W,) scenario of each slot.
        was_played: (n,) scenarios that were played so far.
        known: (n, 2) number and serial among the ``StoredWorlds`` of the world of each scenario when it was played
            last; serial 0 for none.
    """

    playing: Int64
    was_played: Bool
    known: Int64


class Recorded(NamedTuple):
    """Recorded worlds of a ``WorldPool`` in flat arrays, and where the worlds of W slots are in them.

    Object n of slot w has the row ``place[w, OBJECTS] + n``; its state at timestep t is the row
    ``place[w, LOG] + t * place[w, NUM_OBJECTS] + n`` of the log; light l at timestep t has the entry
    ``place[w, LIGHTS] + l * place[w, NUM_STEPS] + t``. Every world has one more row of objects, for the end of its
    last path and its last stop.

    Attributes:
        place: (W, NUM_PLACES), see above.
        log: (R, 8), see ``arrays.log``.
        driver: (O,) policy of each object.
        object_type, size, top_speed: (O,) codes of ``ObjectType``; (O, 3) [m]; (O,) highest recorded speed [m/s].
        friction: (O,) factor on the grip of the road that they are on.
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
    friction: Float64
    path: Float32
    path_offsets: Int32
    stop_arc: Float32
    stop_light: Int32
    stop_offsets: Int32
    light_state: UInt8


CELLS_IN_BLOCK = 256
"""Cells of a grid whose filled ones are counted from the same number, so that the count takes one byte a cell."""


class Lines(NamedTuple):
    """Line segments of the maps of W slots, cell by cell of a grid each, so that a ray reads them in sequence.

    Most cells are empty, so only filled ones have a place for the number of their first segment: cell c of slot w is
    the filled cell ``f = block_start[place[w, BLOCKS] + c // CELLS_IN_BLOCK] + cell_rank[place[w, CELLS] + c]``, which
    has the segments ``filled_start[f]`` to ``filled_start[f + 1]``.

    Attributes:
        place: (W, NUM_PLACES), see ``Recorded``.
        frame: (W, 10) x, y of the lower left corner and side of a cell [m]; numbers of columns and rows; then those
            of the grid of pieces.
        cell_types: (C,) types in the cell, as bits of ``LINE_BITS``; 0 for an empty cell.
        cell_rank: (C,) number of filled cells before the cell in its block.
        block_start: (D,) first filled cell of each block.
        filled_start: (F,) first segment of each filled cell, with one more entry for every map.
        segments: (K, 4) x0, y0, x1, y1 [m]; a segment is in every cell that it touches.
        segment_type: (K,) codes of ``MapFeatureType``.
        piece_start: (E,) first piece of each cell of their grid, with one more entry for every map.
        pieces: (L, 8) see ``RoadPieces``; none until a sensor asks for them.
    """

    place: Int64
    frame: Float64
    cell_types: UInt8
    cell_rank: UInt8
    block_start: Int32
    filled_start: Int32
    segments: Float32
    segment_type: UInt8
    piece_start: Int32
    pieces: Float32


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
