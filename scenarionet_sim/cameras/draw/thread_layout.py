"""Arrays of cameras on a graphics card, which ``thread_items`` and ``thread_pixels`` read and write."""

from __future__ import annotations

from typing import NamedTuple

from scenarionet_data.arrays.dtypes import Float32, Float64, Int32

SPIN, STEER, COS, SIN, NUM_BOX = 7, 8, 9, 10, 11
"""Columns of ``Items.boxes`` behind x, y, z, heading, length, width, height; and their number."""

MESH, ITEM_CLASS, PAINT, GLOW, HAS_SHADOW, IS_SMALL, IS_OUTLINE, NUM_ITEM = range(8)
"""Columns of ``Items.kinds``: mesh to draw or -1, class, paint, shining material or -1, whether there is a shadow,
whether triangles have one colour, and whether an outline stands for all of them; and their number."""

FIRST, END, FIRST_VERTEX, LEFT, TOP, RIGHT, BOTTOM, NUM_INSTANCE = range(8)
"""Columns of ``Items.instances``: triangles and first vertex, counted from those of the frame, bounds on the screen
[pixels]; and their number."""

NUM_INSTANCES, NUM_SHADOWS, NUM_TRIANGLES, NUM_VERTICES, NUM_COUNTS = range(5)
"""Columns of ``Items.counts``, and their number."""

DrawingOptions = tuple[bool, bool, float, float]
"""Whether objects are boxes, whether colours are wanted, reach [m], time of the flow [s]."""


class Shots(NamedTuple):
    """The cameras of a call.

    Attributes:
        owners: (B, 3) slot, row of the own vehicle or -1, and how it is shown.
        poses: (B, NUM_POSE) cameras.
        lens: (NUM_LENS,).
        rays: (H, W, 3) directions right, down, ahead; unused by a pinhole.
        rings: (0,) unused: lidars are drawn by the processor.
    """

    owners: Int32
    poses: Float64
    lens: Float64
    rays: Float64
    rings: Float64


class Items(NamedTuple):
    """Objects and fixtures of B frames, N each.

    Attributes:
        boxes: (B, N, NUM_BOX), see above.
        kinds: (B, N, NUM_ITEM), see above.
        shadows: (B, N, 12) see ``FrameMemory.shadows``; after ``list_items`` the first ones are those in view.
        drawn: (B, N) items in view.
        instances: (B, N, NUM_INSTANCE) see above, of the items in ``drawn``.
        counts: (B, NUM_COUNTS), see above.
    """

    boxes: Float64
    kinds: Int32
    shadows: Float64
    drawn: Int32
    instances: Int32
    counts: Int32


class Triangles(NamedTuple):
    """Triangles of all frames, see ``FrameMemory``; those out of view have empty bounds.

    Attributes:
        first: (B, 2) first triangle and first vertex of each frame.
        vertices, lights: (NUM_VERTEX, V), (NUM_LIGHTS, V).
        edges, spans, colors, labels, bounds: (T, 12), (T, 12), (T, 12), (T, 3), (T, 4).
    """

    first: Int32
    vertices: Float64
    lights: Float32
    edges: Float64
    spans: Float64
    colors: Float32
    labels: Int32
    bounds: Int32


class PixelMemory(NamedTuple):
    """Memory of a thread, see ``FrameMemory``, for tiles of one pixel.

    Attributes:
        near, seen, cells, texels: (1,).
        shades: (NUM_SHADES, 1).
    """

    near: Float32
    seen: Int32
    shades: Float32
    cells: Int32
    texels: Int32
