"""What lenses, surfaces, strokes, materials, meshes and classes there are, by number."""

from __future__ import annotations

PINHOLE, DISTORTED, FISHEYE, RINGS = range(4)
"""Kinds of lens: ``lens[KIND]``."""

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
    TREE_FAR, TREE_TINY, TREE_DOT, CONIFER_MIDDLE, CONIFER_FAR, CONIFER_TINY, POLE_FAR, SPECK, LAMP, LAMP_FAR,
) = range(35)  # fmt: skip
"""Meshes; those for small pictures are the last."""

(
    SKY, ROADWAY, LANE_PAINT, CROSSING, PAVEMENT, TERRAIN, BUILDING_CLASS, VEGETATION, POLE_CLASS, TRAFFIC_LIGHT,
    CAR_CLASS, TRUCK_CLASS, BUS_CLASS, PERSON, RIDER, CONE_CLASS, FENCE, OBJECT_CLASS, SIGN_CLASS, OWN_VEHICLE,
) = range(20)  # fmt: skip
"""Classes of the semantic channel, see ``cameras.classes``."""

SEES_GROUND, SEES_TRIANGLE, SEES_SKY = 1, 2, 4
"""Bits of what the pixels of a tile see."""

NOTHING, ON_GROUND = -2, -1
"""Values of ``FrameMemory.seen`` besides triangles, which are 0 and above."""
