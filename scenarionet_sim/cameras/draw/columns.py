"""Meaning of the columns and rows of arrays that the kernels of cameras read and write."""

from __future__ import annotations

KIND, FX, FY, CX, CY, K1, K2, P1, P2, K3 = range(10)
"""Columns of a lens: kind, focal lengths and principal point [pixels], coefficients of distortion."""

NUM_LENS = 10

EYE, RIGHT, DOWN, FORWARD, VELOCITY, YAW_SPEED, PIVOT = 0, 3, 6, 9, 12, 14, 15
"""First columns of a pose: position [m]; axes of the camera in the scenario's frame; velocity [m/s] and yaw rate
[rad/s] of the vehicle, and the point that it turns about [m]."""

NUM_POSE = 17

(
    VERTEX_FIRST, VERTEX_END, TRIANGLE_FIRST, TRIANGLE_END, COARSER, COARSER_BELOW, IS_GLOSSY, IS_ONE_SIDED,
) = range(8)  # fmt: skip
"""Columns of ``Meshes.ranges``."""

LOW, HIGH, WIDE, SLOPE, BEND, DEEP, NUM_OUTLINE = range(7)
"""Columns of ``Meshes.outlines``, and their number."""

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
"""Triple of ``FrameMemory.shades``: distance in lengths of the ray, ray, distance [m], point seen in the frame of the
ground's grid [m], sunlight that arrives, light; then of the ground: footprint across and along the direction of view
[m], noise, shares of road and pavement, distances to their borders, shares of paint, and horizontal directions of
view; at last the brightness of the picture."""

NUM_SHADES = 25

SUN, SUNLIGHT, SKYLIGHT, BOUNCE, ZENITH, HORIZON = range(0, 18, 3)
"""First columns of ``Look.lights``: direction to the sun; linear RGB of sunlight, of light from above and from
below, of the sky overhead and at the horizon."""

HAZE, CLOUD, WET, EXPOSURE, LAMPS, SHADOW, VIGNETTE, SHIFT, NIGHT = range(18, 27)
"""Other columns: density of haze [1/m], share of cloud, wetness, exposure, brightness of lamps, strength of shadows,
vignette, a shift of all textures [texels], and 1 at night: then sunlight is the light of lamps, near them."""

NUM_LIGHT = 27
