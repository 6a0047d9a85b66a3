"""Arrays that the kernels of cameras read and write."""

from __future__ import annotations

from typing import NamedTuple

from scenarionet_data.arrays.dtypes import Array, Bool, Float32, Float64, Int32, Int64, UInt8

BAND = 8
"""Triple of a band, the part of a frame that a thread draws at a time."""

BANDS = 2
"""Bands that a thread draws one after another."""

LANES = 32
"""Loops compute so many pixels at a time, and the rest one by one."""

TILE = 384
"""Most pixels of a band drawn at a time, a multiple of ``LANES``: their values stay in the processor's cache."""

GROUP = 16
"""Fixtures that are measured at once."""

SKY_STEP = 8
"""The sky is computed at every eighth row and column, and interpolated between."""


Triple = tuple[Float32, Float32, Float32]
Places = tuple[Float64, Float64, Float64]
"""Triple of arrays: red, green and blue, or x, y and z."""


class Ground(NamedTuple):
    """The ground of every world: surfaces and paint in the cells of a grid, and heights.

    Attributes:
        place: (W, 2) int64 first cell and first height of each slot's world.
        frame: (W, 5) x, y of the lower left corner, side of a cell [m]; numbers of columns and rows.
        height_frame: (W, 5) of the grid of heights in the same form; no columns where the ground is level.
        level: (W,) height of level ground [m].
        corner: (C,) surface bits at the lower left corner of each cell, and whether it has strokes.
        cell_start: (C,) first stroke of each cell, with one more entry for every world.
        strokes: (K, 6), see the kinds of stroke.
        stroke_kind: (K,) kind of stroke.
        heights: (H,) heights [m] at the corners of the cells, row by row.
    """

    place: Int64
    frame: Float64
    height_frame: Float64
    level: Float64
    corner: UInt8
    cell_start: Int64
    strokes: Float32
    stroke_kind: UInt8
    heights: Float32


class Solids(NamedTuple):
    """Everything that stands on the ground.

    Attributes:
        motion, size, object_type, present, timestep: Of the state, see ``State``.
        dt: (W,) of a timestep [s].
        place, log, light_state: Of the recorded worlds, see ``arrays.structures.Recorded``.
        fixed_range: (W, 2) first and end group of each slot's fixtures.
        fixed: (F, 7, GROUP) x, y, z [m] of the base, heading [rad], length, width, height [m]; x is infinite in the
            places of the last group that are left over.
        fixed_kind: (F, GROUP, 4) mesh, class, colour, and traffic light or -1.
        light_color: (14,) colour of each light state, codes of ``LightColor``.
    """

    motion: Float64
    size: Float64
    object_type: UInt8
    present: Bool
    timestep: Int32
    dt: Float64
    place: Int64
    log: Float32
    light_state: UInt8
    fixed_range: Int64
    fixed: Float32
    fixed_kind: Int32
    light_color: UInt8


class Meshes(NamedTuple):
    """Meshes in the unit box: x from -0.5 (rear) to 0.5, y from -0.5 (right) to 0.5, z from 0 to 1.

    Attributes:
        ranges: (M, 8) first and end vertex, first and end triangle, the next coarser mesh and the radius on the screen
            [pixels] below which it is drawn instead, whether a material mirrors, and whether only its rear side is
            made, which then faces the camera.
        vertices: (6, V) position and normal.
        part: (V,) 0, or 1 + the joint that the vertex is on.
        corners: (T, 3) vertices of each triangle, counter-clockwise from outside.
        material: (T,) material.
        joints: (M, 8, 5) where parts turn about the axis y, in the unit box's measures: centres of four wheels with
            their radii in x and z; then of limbs, two that swing forward and two that swing backward. Below the ground
            where there is none.
        colors: (P, 3) linear RGB of materials, then of the paint of instances.
        outlines: (M, NUM_OUTLINE) outline that stands for the mesh in a pinhole's picture: its lowest and highest place
            in the unit box, half its width in the middle, the slope and bend of the width from there to the foot, and
            how far it is before the middle of the box; no width where there is none.
    """

    ranges: Int32
    vertices: Float32
    part: UInt8
    corners: Int32
    material: UInt8
    joints: Float32
    colors: Float32
    outlines: Float32


class Look(NamedTuple):
    """Light, weather and textures.

    Attributes:
        lights: (B, NUM_LIGHT) light and weather of each frame.
        grain: (2, S * S) uint8 fine and coarse noise, row by row.
        tone: (9,) factors of the powers of the logarithm of linear light, scaled to -1 to 1 between
            ``shading.OCTAVES``, whose sum is 0.5 more than the sRGB level.
    """

    lights: Float64
    grain: UInt8
    tone: Float32


class Shots(NamedTuple):
    """The cameras of a call.

    Attributes:
        owners: (B, 3) slot, row of the own vehicle or -1, and how it is shown.
        poses: (B, NUM_POSE) cameras.
        lens: (NUM_LENS,).
        rays: (H, W, 3) directions right, down, ahead; unused by a pinhole.
        rings: (H,) descending slopes of a lidar's rings; unused by others.
        width, height: [pixels].
        reach: Farthest visible distance along a ray [m].
        flow_time: Time between the two pictures of the flow [s].
        are_boxes: Whether objects are boxes.
        is_colored: Whether colours are wanted.
    """

    owners: Int32
    poses: Float64
    lens: Float64
    rays: Float64
    rings: Float64
    width: int
    height: int
    reach: float
    flow_time: float
    are_boxes: bool
    is_colored: bool


class FrameView(NamedTuple):
    """The camera of one frame: slot, own vehicle, pose and light, see ``Look.lights``; the others as in ``Shots``."""

    slot: int
    own: int
    own_view: int
    pose: Float64
    light: Float64
    lens: Float64
    rays: Float64
    rings: Float64
    width: int
    height: int
    reach: float
    flow_time: float
    are_boxes: bool
    is_colored: bool


class Item(NamedTuple):
    """An object or a fixture in view.

    Attributes:
        row: In the state, or -1.
        box: (7,) x, y, z, heading, length, width, height.
        mesh, turn: Mesh to draw, and cosine and sine of its heading.
        semantic, paint: Class, and colour of ``BODY``.
        glow: Material that shines, or -1.
        moves: How far wheels rolled [m] and are steered [rad], and how far limbs swing [rad].
        is_small: Whether triangles have one colour.
        lit: Share of sunlight that arrives; of the light of lamps at night.
    """

    row: int
    box: Float64
    mesh: int
    turn: tuple[float, float]
    semantic: int
    paint: int
    glow: int
    moves: tuple[float, float, float]
    is_small: bool
    lit: float


class Vertices(NamedTuple):
    """Vertices of one mesh in view, and the light on them.

    Attributes:
        places: (NUM_VERTEX, V), see ``columns``.
        lights: (NUM_LIGHTS, V), see ``columns``.
    """

    places: Float64
    lights: Float32


class Triangles(NamedTuple):
    """Triangles in view.

    Attributes:
        edges: (T, 12) of other lenses than pinholes: three edge functions and the inverse depth, each over the
            direction of a ray.
        spans: (T, 12) of a pinhole: column at row 0 and slope of each edge, 1 where it is a left edge; inverse depth at
            the first pixel, and its steps along a row and a column. Of outlines: see ``outlines.add_outline``.
        colors: (T, 12) linear RGB at column and row 0, each with its steps along a row and a column; and the normal.
        labels: (T, 3), see ``columns``.
        bounds: (T, 4) on the screen: left, top, right end, bottom end.
    """

    edges: Float64
    spans: Float64
    colors: Float32
    labels: Int32
    bounds: Int32


class Tile(NamedTuple):
    """Memory for some pixels of a row or of several rows in a band.

    Attributes:
        near: (N,) inverse depth of the nearest triangle.
        seen: (N,) the nearest triangle or -1; then what is seen.
        shades: (NUM_SHADES, N) values of pixels, see ``columns``; on the processor longer by ``LANES``.
        cells: (N,) cells of the ground.
        texels: (N,) texels of its noise, and its surfaces.
        nodes: (3, columns / SKY_STEP + 2 + LANES) light of the sky at the nodes of a row.
        sky: (2, 4, columns + SKY_STEP) light of the sky in the rows above and below a band, see ``sky``.
    """

    near: Float32
    seen: Int32
    shades: Float32
    cells: Int32
    texels: Int32
    nodes: Float32
    sky: Float32


class FrameMemory(NamedTuple):
    """Memory of one thread: triangles in view of a frame, and shadows.

    Attributes:
        vertices: Of one mesh in view.
        triangles: Of the frame.
        instances: (I, NUM_INSTANCE), see ``columns``.
        shadows: (I, NUM_SHADOW) x, y, cos, sin, half length, half width, sweep x, y in its frame, its screen bounds,
            and how dark it is where the object stands; below 0 how bright the light of a lamp is there.
        places: (2, BAND) first columns and ends of a triangle in the rows of a band.
        band: Pixels of a band; all but ``near`` and ``seen`` hold those of a tile.
        box: (7,) of an object.
        radii, has_shadow: (GROUPS * GROUP,) radii of fixtures on the screen [pixels], and 1 where they have shadows in
            view.
        listed: (GROUPS * GROUP,) objects or fixtures that may be in view.
    """

    vertices: Vertices
    triangles: Triangles
    instances: Int32
    shadows: Float64
    places: Int32
    band: Tile
    box: Float64
    radii: Float32
    has_shadow: Int32
    listed: Int32


class SceneArrays(NamedTuple):
    """What the cameras of a call see."""

    solids: Solids
    ground: Ground
    meshes: Meshes
    look: Look


Pictures = tuple[Array, ...]
"""Outputs by channel, in the order of ``channels.CHANNELS``, each (B, H * W) or (B, H * W, values), that of ``rgb``
(B, H * W * 3); arrays of channels that are not wanted have no frames."""
