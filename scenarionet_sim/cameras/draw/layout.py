"""Arrays that the kernels of cameras read, and the meaning of their columns."""

from __future__ import annotations

from typing import NamedTuple

from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Int32, Int64, UInt8

PINHOLE, DISTORTED, FISHEYE, RINGS = range(4)
"""Kinds of lens: ``lens[KIND]``."""

KIND, FX, FY, CX, CY, K1, K2, P1, P2, K3 = range(10)
"""Columns of a lens: kind, focal lengths and principal point [pixels], coefficients of distortion."""

NUM_LENS = 10

EYE, RIGHT, DOWN, FORWARD, VELOCITY, YAW_SPEED, PIVOT = 0, 3, 6, 9, 12, 14, 15
"""First columns of a pose: position [m]; axes of the camera in the scenario's frame; velocity [m/s] and yaw rate
[rad/s] of the vehicle, and the point that it turns about [m]."""

NUM_POSE = 17

HIDDEN, OUTSIDE, INSIDE = range(3)
"""How the own vehicle is shown: not, as others, or as its driver sees it."""

ROAD, SIDEWALK, CROSSWALK, HAS_STROKES = 1, 2, 4, 128
"""Bits of the surface at a point of the ground; none of them is terrain. The last one marks cells with strokes."""

ROAD_BORDER, SIDEWALK_BORDER, CROSSWALK_BORDER, WHITE, YELLOW, CROSSWALK_BAR, KERB = range(7)
"""Kinds of stroke. A border is an edge x0, y0, x1, y1 of the outline of a surface; others are painted rectangles: start
x, y, direction x, y, length and half the width."""

(
    BODY, GLASS, TYRE, HEADLAMP, TAIL_LAMP, TRIM, SKIN, CLOTH, TROUSERS, ORANGE, REFLECTIVE, LEAF, BARK, FACADE, ROOF,
    METAL, HOUSING, LAMP_RED, LAMP_YELLOW, LAMP_GREEN, INTERIOR,
) = range(21)  # fmt: skip
"""Materials of triangles; ``BODY`` has the colour of its instance."""

(
    BOX, CAR, VAN, TRUCK, BUS, PEDESTRIAN, CYCLIST, CONE, BARRIER, LIGHT_HEAD, POLE, TREE, CONIFER, BUILDING, SIGN,
    DECK, CAR_FAR, TRUCK_FAR, PERSON_FAR, BLOCK, WALLS, LIGHT_FAR, CAR_MIDDLE, VAN_MIDDLE, TREE_MIDDLE,
    TREE_FAR, TREE_TINY, TREE_DOT, CONIFER_MIDDLE, CONIFER_FAR, CONIFER_TINY, POLE_FAR, SPECK,
) = range(33)  # fmt: skip
"""Meshes; those for small pictures are the last."""

(
    VERTEX_FIRST, VERTEX_END, TRIANGLE_FIRST, TRIANGLE_END, COARSER, COARSER_BELOW, IS_GLOSSY, IS_ONE_SIDED,
) = range(8)  # fmt: skip
"""Columns of ``Meshes.ranges``."""

LOW, HIGH, WIDE, SLOPE, BEND, DEEP, NUM_OUTLINE = range(7)
"""Columns of ``Meshes.outlines``, and their number."""

(
    SKY, ROADWAY, LANE_PAINT, CROSSING, PAVEMENT, TERRAIN, BUILDING_CLASS, VEGETATION, POLE_CLASS, TRAFFIC_LIGHT,
    CAR_CLASS, TRUCK_CLASS, BUS_CLASS, PERSON, RIDER, CONE_CLASS, FENCE, OBJECT_CLASS, SIGN_CLASS, OWN_VEHICLE,
) = range(20)  # fmt: skip
"""Classes of the semantic channel, see ``cameras.classes``."""

TRI_FIRST, TRI_END, TOP, BOTTOM, IS_OUTLINE, NUM_INSTANCE = range(6)
"""Columns of an instance in view: its triangles, its first and end row on the screen, and whether it is drawn as an
outline; and their number."""

INSTANCE_ROW, SEMANTIC, MATERIAL = range(3)
"""Columns of ``FrameMemory.labels``: row in the state or -1, class, material."""

VIEW, COLUMN, ROW, AWAY = 0, 3, 4, 5
"""First rows of ``FrameMemory.vertices``: right, below and ahead of the camera [m]; place on the screen [pixels], or
azimuth [rad] and slope for a lidar; from the camera in the scenario's frame [m]."""

NUM_VERTEX = 8

DIFFUSE, MIRROR, GLOSS, NORMAL = 0, 3, 6, 9
"""First rows of ``FrameMemory.lights``. Linear RGB: light that arrives; what is mirrored; and mirrored in addition by
the angle of view. Then the normal, a unit vector in the scenario's frame where the light is written."""

NUM_LIGHTS = 12

(
    DISTANCE, RAY_X, RAY_Y, RAY_Z, FAR, GROUND_X, GROUND_Y, SHADE, RED, GREEN, BLUE, ACROSS, ALONG, FINE, COARSE,
    ON_ROAD, ON_WALK, ROAD_EDGE, WALK_EDGE, WHITE_SHARE, YELLOW_SHARE, KERB_SHARE, VIEW_X, VIEW_Y, GAIN,
) = range(25)  # fmt: skip
"""Rows of ``FrameMemory.shades``: distance in lengths of the ray, ray, distance [m], point seen in the frame of the
ground's grid [m], sunlight that arrives, light; then of the ground: footprint across and along the direction of view
[m], noise, shares of road and pavement, distances to their borders, shares of paint, and horizontal directions of
view; at last the brightness of the picture."""

NUM_SHADES = 25

SEES_GROUND, SEES_TRIANGLE, SEES_SKY = 1, 2, 4
"""Bits of what the pixels of a tile see."""

NOTHING, ON_GROUND = -2, -1
"""Values of ``FrameMemory.seen`` besides triangles, which are 0 and above."""

BAND = 8
"""Rows of a band, the part of a frame that a thread draws at a time."""

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
        part: (V,) 0, or 1 + the wheel that the vertex is on.
        corners: (T, 3) vertices of each triangle, counter-clockwise from outside.
        material: (T,) material.
        wheels: (M, 4, 5) centre of each wheel and its radii in x and z, in the unit box's measures.
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
    wheels: Float32
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


SUN, SUNLIGHT, SKYLIGHT, BOUNCE, ZENITH, HORIZON = range(0, 18, 3)
"""First columns of ``Look.lights``: direction to the sun; linear RGB of sunlight, of light from above and from
below, of the sky overhead and at the horizon."""

HAZE, CLOUD, WET, EXPOSURE, LAMPS, SHADOW, VIGNETTE, SHIFT = range(18, 26)
"""Other columns: density of haze [1/m], share of cloud, wetness, exposure, brightness of lamps, strength of shadows,
vignette, and a shift of all textures [texels]."""

NUM_LIGHT = 26


class FrameMemory(NamedTuple):
    """Memory of one thread: triangles in view of a frame, shadows, and the pixels of a band.

    Attributes:
        vertices: (NUM_VERTEX, V) of one mesh in view, see above.
        lights: (NUM_LIGHTS, V) light on them, see above.
        edges: (T, 12) of other lenses than pinholes: three edge functions and the inverse depth, each over the
            direction of a ray.
        spans: (T, 12) of a pinhole: column at row 0 and slope of each edge, 1 where it is a left edge; inverse depth at
            the first pixel, and its steps along a row and a column. Of outlines: see ``outlines.add_outline``.
        colors: (T, 12) linear RGB at column and row 0, each with its steps along a row and a column; and the normal.
        labels: (T, 3), see above.
        bounds: (T, 4) on the screen: left, top, right end, bottom end.
        instances: (I, NUM_INSTANCE), see above.
        shadows: (I, 12) x, y, cos, sin, half length, half width, sweep x, y in its frame, and its screen bounds.
        places: (2, BAND) first columns and ends of a triangle in the rows of a band.
        near: (BAND * columns,) inverse depth of the nearest triangle.
        seen: (BAND * columns,) the nearest triangle or -1.
        shades: (NUM_SHADES, TILE + LANES) values of the pixels of a tile, see above.
        cells: (TILE,) cells of the ground.
        texels: (TILE,) texels of its noise, and its surfaces.
        box: (7,) of an object.
        radii, has_shadow: (GROUPS * GROUP,) radii of fixtures on the screen [pixels], and 1 where they have shadows in
            view.
        listed: (GROUPS * GROUP,) objects or fixtures that may be in view.
        nodes: (3, columns / SKY_STEP + 2 + LANES) light of the sky at the nodes of a row.
        sky: (2, 4, columns + SKY_STEP) light of the sky in the rows above and below a band, see ``sky``.
    """

    vertices: Float64
    lights: Float32
    edges: Float64
    spans: Float64
    colors: Float32
    labels: Int32
    bounds: Int32
    instances: Int32
    shadows: Float64
    places: Int32
    near: Float32
    seen: Int32
    shades: Float32
    cells: Int32
    texels: Int32
    box: Float64
    radii: Float32
    has_shadow: Int32
    listed: Int32
    nodes: Float32
    sky: Float32


class Pictures(NamedTuple):
    """Outputs, row by row; arrays of channels that are not wanted have no frames.

    Attributes:
        rgb: (B, H * W * 3) uint8.
        depth: (B, H * W) float32 [m].
        semantic: (B, H * W) uint8 class.
        instance: (B, H * W) int32 row of the state, or -1.
        normals: (B, H * W, 3) float32 unit vectors in the scenario's frame, 0 in the sky.
        flow: (B, H * W, 2) float32 [pixels].
    """

    rgb: UInt8
    depth: Float32
    semantic: UInt8
    instance: Int32
    normals: Float32
    flow: Float32
